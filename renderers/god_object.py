"""The constraint projection (4.3): the tool slides on the surface after the hand, and never passes through it.

Zilles and Salisbury's god-object, or proxy.

- In free space a straight motion of the hand that goes inside starts the contact where it does.
- In contact the tool slides downhill in distance, over as many pieces as one tick needs, and rests in concave corners.
- It is released where the hand is outside the half-plane of the face that it is on, or, at a convex corner, of the next
  one: without that test a tool would walk round a 60 degree tip.
- A released tool flies straight to the hand, and what it runs into on the way is a new contact.

On a triangle mesh it slides over faces, along edges and into corners, and rests where no motion on the mesh leads
closer to the hand. It is released where the hand is free: on a face when it is outside of its plane, at a convex edge
of one of the two planes, at a concave one of both.
"""

from __future__ import annotations

from hapticeval.compiled import LawData, borrowing, compiled, inner
from hapticeval.geometry.mesh import Mesh
from hapticeval.geometry.mesh_kernels import closest_feature, closest_on_mesh, side_and_normal
from hapticeval.geometry.mesh_tool import RESTS, fly_to_hand, walk_downhill
from hapticeval.renderers.family import VERTICES
from hapticeval.renderers.law import BILATERAL, ERROR, OWN, ROOM, move_on, regulate, release
from hapticeval.renderers.outline import (
    LEAVES,
    Outline,
    evaluate_at,
    first_contact,
    frame,
    nearest_on,
    outline_in,
    representation_of,
    slide,
)
from hapticeval.renderers.projective import CompiledProjection
from hapticeval.scene import Scene
from hapticeval.types import Array

TOUCHES, PIECE, AT, HIP_X, HIP_Y = range(ROOM[2], ROOM[2] + 5)
"""In `state`: whether the tool is in contact, where on which piece, and the last HIP."""

FLIGHTS = 64
"""Releases within one tick after which the side of the hand decides; each brings the tool closer to it."""


def god_object(scene: Scene, representation: str, *, vertices: float = VERTICES) -> CompiledProjection:
    """Return the constraint projection on a polygon or a curve, or on a triangle mesh, which is its own polygon.

    A run that starts with the hand inside starts in contact at the nearest surface point. In a bilateral scene the tool
    is never released: it follows the same local minimum of the distance with the hand on either side.
    """
    if isinstance(scene.model.boundary, Mesh):
        return on_mesh(scene, scene.model.boundary)
    shape = representation_of(scene.model, representation, int(vertices))
    return CompiledProjection(
        follow, shape.surface, bilateral=scene.bilateral, memory=5, begin=begin, rows=follow_rows, **shape.tables
    )


@borrowing
def begin(data: LawData, hip: Array) -> None:
    """Put the tool where a run starts with the hand at `hip` (2,), m: if that is inside, on the nearest point."""
    state = data.state
    piece, u, _, side = nearest_on(outline_in(data), hip[0], hip[1])
    state[TOUCHES] = 1.0 if data.params[BILATERAL] != 0.0 or side < 0.0 else 0.0
    state[PIECE], state[AT], state[HIP_X], state[HIP_Y] = piece, u, hip[0], hip[1]


@inner
def follow(
    data: LawData, hip: Array, velocity: Array, push: Array, dt: float, ihip: Array, force: Array  # noqa: ARG001
) -> int:  # fmt: skip
    """One tick of the constraint projection (4.3), of signature `LAW`: from the last IHIP, or the last HIP if free.

    `hip` (2,), m, and `velocity` (2,), m/s, are the hand's; `ihip` (2,), m, and `force` (2,), N, are written.
    """
    b, params, state = outline_in(data), data.params, data.state
    x, y = hip[0], hip[1]
    touches, piece, u = state[TOUCHES] != 0.0, int(state[PIECE]), state[AT]
    status = LEAVES
    if touches:  # downhill in distance, from where the tool is
        status, piece, u = slide(b.pieces, b.joints, params[BILATERAL] == 0.0, piece, u, x, y)
    if status == LEAVES:  # free, or released just now: straight to the hand
        x0, y0 = state[HIP_X], state[HIP_Y]
        if touches:
            x0, y0, _, _, _, _ = evaluate_at(b.pieces, piece, u)
        touches, piece, u = _fly(b, touches, x0, y0, x, y)
        state[TOUCHES] = 1.0 if touches else 0.0
    # the next tick goes on from here
    state[PIECE], state[AT], state[HIP_X], state[HIP_Y] = piece, u, x, y
    if not touches:
        return release(state, hip, ihip, force)
    ihip[0], ihip[1], state[ERROR + 2], state[ERROR + 3] = frame(b.pieces, b.joints, piece, u, x, y)
    return regulate(params, state, hip, velocity, 0.0, dt, ihip, force)


@borrowing
def follow_rows(
    data: LawData, push: Array, hips: Array, velocity: Array, dt: float, ihips: Array, forces: Array
) -> tuple[int, int]:
    """Answer each row of a path, as `answer_rows` does: a tick on a polygon takes less time than a call by `LAW`.

    `hips` (n, N), m, `velocity` (N,), m/s, at the first, `push` (N,), N; `ihips` (n, N), m, and `forces` (n, N), N, are
    written. Returns n and 0: it never refuses.
    """
    for row in range(hips.shape[0]):
        move_on(hips, row, dt, velocity)
        follow(data, hips[row], velocity, push, dt, ihips[row], forces[row])
    return hips.shape[0], 0


@borrowing
def _fly(b: Outline, released: bool, x0: float, y0: float, x: float, y: float) -> tuple[bool, int, float]:
    """Straight to the hand at (x, y) from (x0, y0), where the tool was `released` from the surface or is free.

    Returns whether the tool runs into something on the way, and the (piece, u) at which it then comes to rest.
    """
    for _flight in range(FLIGHTS):
        touches, piece, u = first_contact(b, x0, y0, x, y, released)
        if not touches:
            return False, piece, u
        # a new contact: slide on from there, and off again where a corner lets it
        status, piece, u = slide(b.pieces, b.joints, True, piece, u, x, y)
        if status != LEAVES:
            return True, piece, u
        released = True
        x0, y0, _, _, _, _ = evaluate_at(b.pieces, piece, u)
    # in a fold that throws it to and fro the side of the hand decides
    piece, u, _, side = nearest_on(b, x, y)
    return side < 0.0, piece, u


MESH_TOUCHES, TRIANGLE, FEATURE, TOOL, HIP = ROOM[3], ROOM[3] + 1, ROOM[3] + 2, ROOM[3] + 3, ROOM[3] + 6
"""In `state`: whether the tool is in contact, on which feature of which triangle, where, and the last HIP.

In free space the triangle is one close to the hand, where the search begins.
"""

TOUCH = OWN
"""In `params`: the mesh's `touch` (m)."""


def on_mesh(scene: Scene, mesh: Mesh) -> CompiledProjection:
    """Return the projection; whether the tool is ever released, and how a run starts, is as in the plane."""
    faces, vertices, tree = mesh.tables
    return CompiledProjection(
        follow_on_mesh,
        mesh,
        bilateral=scene.bilateral,
        own=[mesh.touch],
        memory=9,
        begin=begin_on_mesh,
        segments=faces,
        vertices=vertices,
        tree=tree,
    )


@compiled
def begin_on_mesh(data: LawData, hip: Array) -> None:
    """Put the tool where a run starts with the hand at `hip` (3,), m: if that is inside, on the nearest point."""
    faces, vertices, tree, state = data.segments, data.vertices, data.tree, data.state
    hand = (hip[0], hip[1], hip[2])
    triangle, feature, foot = closest_feature(faces, vertices, tree, hand, 0)
    _, _, _, distance = closest_on_mesh(faces, vertices, tree, hand, triangle)
    state[MESH_TOUCHES] = 1.0 if data.params[BILATERAL] != 0.0 or distance < 0.0 else 0.0
    state[TRIANGLE], state[FEATURE] = triangle, feature
    for i in range(3):
        state[TOOL + i], state[HIP + i] = foot[i], hip[i]


@compiled
def follow_on_mesh(
    data: LawData, hip: Array, velocity: Array, push: Array, dt: float, ihip: Array, force: Array  # noqa: ARG001
) -> int:  # fmt: skip
    """One tick of the constraint projection (4.3), of signature `LAW`: from the last IHIP, or the last HIP if free.

    `hip` (3,), m, and `velocity` (3,), m/s, are the hand's; `ihip` (3,), m, and `force` (3,), N, are written.
    """
    faces, vertices, params, state = data.segments, data.vertices, data.params, data.state
    hand, triangle, feature = (hip[0], hip[1], hip[2]), int(state[TRIANGLE]), int(state[FEATURE])
    tool = (state[TOOL], state[TOOL + 1], state[TOOL + 2])
    touches = state[MESH_TOUCHES] != 0.0
    rests = False
    if touches:  # over faces, along edges and into corners, downhill in distance
        status, triangle, feature, tool = walk_downhill(
            faces, vertices, params[BILATERAL] == 0.0, triangle, feature, tool, hand
        )
        rests = status == RESTS
    if not rests:  # free, or released just now: straight to the hand
        start = tool if touches else (state[HIP], state[HIP + 1], state[HIP + 2])
        touches, triangle, feature, tool = fly_to_hand(faces, vertices, data.tree, params[TOUCH], start, hand, triangle)
    state[MESH_TOUCHES], state[TRIANGLE], state[FEATURE] = 1.0 if touches else 0.0, triangle, feature
    for i in range(3):
        state[TOOL + i], state[HIP + i] = tool[i], hip[i]
    if not touches:
        return release(state, hip, ihip, force)
    # on an edge or at a corner the normal is along the error
    tool_to_hand = (hip[0] - tool[0], hip[1] - tool[1], hip[2] - tool[2])
    _, normal = side_and_normal(faces, vertices, triangle, feature, tool, tool_to_hand)
    for i in range(3):
        ihip[i], state[ERROR + 3 + i] = tool[i], normal[i]
    return regulate(params, state, hip, velocity, 0.0, dt, ihip, force)
