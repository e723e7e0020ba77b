"""The constraint projection's sliding: along a curve, downhill in distance, until the error would increase (4.3).

The distance of the hand p from the curve y(u) falls while g(u) = (p - y)·y' points onwards. A march towards the first
zero of g must not step over one: a low barrier skipped would be a pop-through that the method does not have. Each
step therefore ends at the first zero of g's upper quadratic bound

    g(u) + g'(u) d + M d^2 / 2,      M = third_0 + third_1 |p - y|  >=  |g''|

which is exact on straight pieces, approaches the zero from the safe side, and converges like Newton's method.
Where the local minimum has vanished (a fold) there is no zero to stop at, and the march goes on to the next: that is
the pop-through of Figure 4.7.
"""

from __future__ import annotations

import math

from hapticeval.compiled import compiled
from hapticeval.geometry.curve_kernels import STRAIGHT
from hapticeval.geometry.kernels import KIND, LINE, U0, U1, A, B, C, D, evaluate
from hapticeval.types import Array

RESTS, LEAVES = 0, 1
LONGEST_MARCH = 100_000
"""Steps on curved pieces after which a march stops where it is; marches at a fold take some hundreds."""


@compiled
def at(pieces: Array, k: int, u: float) -> tuple[float, float, float, float, float, float]:
    """`evaluate` on piece k; straight pieces, by far the most, without the cost of a view of the row."""
    if pieces[k, KIND] == LINE:
        along = u - pieces[k, U0]
        dx, dy = pieces[k, C], pieces[k, D]
        return pieces[k, A] + along * dx, pieces[k, B] + along * dy, dx, dy, 0.0, 0.0
    return evaluate(pieces[k], u)


@compiled
def slide(
    pieces: Array,
    joints: Array,
    third: Array,
    closed: bool,
    releases: bool,
    piece: int,
    u: float,
    x: float,
    y: float,
) -> tuple[int, int, float]:
    """From (piece, u) downhill to the local minimum of the distance to (x, y): (RESTS or LEAVES, piece, u).

    With `releases` (unilateral contact) it LEAVES where the HIP is above the tangent half-plane: of the piece it is
    on, or, at a convex joint, of the piece it would go to. At a concave joint it rests on the corner, or goes on
    where the next piece leads further downhill. A rest at a joint has u exactly at the end of its piece. From a
    point of exactly largest distance both ways lead downhill: it goes anticlockwise.
    """
    count = pieces.shape[0]
    onwards = 0.0
    steps = 0
    while True:
        px, py, dx, dy, ddx, ddy = at(pieces, piece, u)
        ex, ey = x - px, y - py
        if releases and ex * dy - ey * dx > 0.0:
            k = _other_wall(pieces, joints, closed, piece, u, x, y) if onwards == 0.0 else -1
            if k < 0:
                return LEAVES, piece, u
            u = pieces[k, U0] if u == pieces[piece, U1] else pieces[k, U1]
            piece = k
            continue
        g = ex * dx + ey * dy
        slope = dx * dx + dy * dy - ex * ddx - ey * ddy
        if onwards == 0.0:
            onwards = 1.0 if g > 0.0 or (g == 0.0 and slope < 0.0) else -1.0
        if g * onwards < 0.0 or (g == 0.0 and slope >= 0.0):
            return RESTS, piece, u
        # a step of zero length means that g has vanished to rounding
        bend = third[piece, 0]
        if third[piece, 1] > 0.0:
            bend += third[piece, 1] * math.hypot(ex, ey)
        step = _first_zero(abs(g), slope, bend)
        following = u + onwards * step
        end = pieces[piece, U1] if onwards > 0.0 else pieces[piece, U0]
        if (end - following) * onwards > 0.0:
            steps += 1
            tiny = 2e-16 * (pieces[piece, U1] - pieces[piece, U0])
            if following == u or bend == 0.0 or step <= tiny or steps > LONGEST_MARCH:
                return RESTS, piece, following
            u = following
            continue
        if not closed:
            return RESTS, piece, following
        k = (piece + 1) % count if onwards > 0.0 else (piece - 1) % count
        start = pieces[k, U0] if onwards > 0.0 else pieces[k, U1]
        turn = joints[k] if onwards > 0.0 else joints[piece]
        px, py, dx, dy, _, _ = at(pieces, k, start)
        ex, ey = x - px, y - py
        if releases and turn > -STRAIGHT and ex * dy - ey * dx > 0.0:
            return LEAVES, piece, end
        if (ex * dx + ey * dy) * onwards <= 0.0:
            return RESTS, piece, end
        piece, u = k, start


@compiled
def _first_zero(g: float, slope: float, bend: float) -> float:
    """The smallest d > 0 with -g + slope d + bend d^2 / 2 = 0, for g > 0; infinite if there is none."""
    if bend == 0.0:
        return g / slope if slope > 0.0 else math.inf
    root = math.sqrt(slope * slope + 2.0 * bend * g)
    return 2.0 * g / (slope + root) if slope > 0.0 else (root - slope) / bend


@compiled
def _other_wall(pieces: Array, joints: Array, closed: bool, piece: int, u: float, x: float, y: float) -> int:
    """The piece that still holds the tool in a concave corner when it is free of `piece`, or -1."""
    if not closed:
        return -1
    count = pieces.shape[0]
    if u == pieces[piece, U1]:
        k = (piece + 1) % count
        turn, there = joints[k], pieces[k, U0]
    elif u == pieces[piece, U0]:
        k = (piece - 1) % count
        turn, there = joints[piece], pieces[k, U1]
    else:
        return -1
    if turn > -STRAIGHT:
        return -1
    px, py, dx, dy, _, _ = at(pieces, k, there)
    return k if (x - px) * dy - (y - py) * dx < 0.0 else -1


@compiled
def frame(
    pieces: Array, joints: Array, closed: bool, piece: int, u: float, x: float, y: float
) -> tuple[float, float, float, float]:
    """The surface point at (piece, u), and the outward unit normal that holds the HIP (x, y) there.

    At a corner every direction between the two faces' normals is one: there it is the direction between HIP and
    IHIP, which is continuous with the faces' normals, or their mean where the two points coincide.
    """
    px, py, dx, dy, _, _ = at(pieces, piece, u)
    first, last = pieces[piece, U0], pieces[piece, U1]
    nx, ny = dy, -dx
    if pieces[piece, KIND] != LINE:
        speed = math.hypot(dx, dy)
        nx, ny = nx / speed, ny / speed
    if closed and u in (first, last):
        count = pieces.shape[0]
        k = (piece + 1) % count if u == last else (piece - 1) % count
        turn = joints[k] if u == last else joints[piece]
        if abs(turn) > STRAIGHT:
            _, _, dx, dy, _, _ = evaluate(pieces[k], pieces[k, U0] if u == pieces[piece, U1] else pieces[k, U1])
            speed = math.hypot(dx, dy)
            mx, my = nx + dy / speed, ny - dx / speed
            ex, ey = x - px, y - py
            far = math.hypot(ex, ey)
            if far > 1e-12 * (abs(px) + abs(py)):
                side = far if ex * mx + ey * my > 0.0 else -far
                return px, py, ex / side, ey / side
            size = math.hypot(mx, my)
            nx, ny = mx / size, my / size
    return px, py, nx, ny
