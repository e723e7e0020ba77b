"""Where the hand passes a corner of a plane model, or an edge or a vertex of a solid, as two phenomena suppose it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import shapely

from hapticeval.geometry.boundary import Boundary, Corner
from hapticeval.geometry.mesh import Mesh
from hapticeval.geometry.mesh_kernels import EDGE, FACE, PSEUDO, VERTEX, normals_in_reach
from hapticeval.geometry.mesh_tool import IN_FREE_SPACE
from hapticeval.phenomena.decisions import (
    BORDER_MISS,
    BORDER_ROUNDING,
    FACE_SAMPLES_SHARE,
    FACE_TURN_SHARE,
    LAG_TICKS,
    SAME_NORMAL,
    SHIFTED_TOOLS_APART,
)
from hapticeval.phenomena.observed import Observed
from hapticeval.phenomena.sampling import worst_of
from hapticeval.phenomena.verdict import Finding
from hapticeval.recordings.recording import runs_of
from hapticeval.types import Array, BoolArray, IntArray

FACE_SAMPLES = 1025
"""Points on a face in the plane, as long as it may be: a chord of one that bends misses it by kappa ds^2 / 8."""

TOOL_RESTS = -2
"""In place of a face: the rigid tool rests on an edge or in a corner."""

UNDECIDED = -3
"""In place of a face: a rounding of the hand's position decides which one the rigid tool is on."""


@dataclass(frozen=True, eq=False)
class Crossing:
    """A corner that the hand passes, with its faces in the order of travel.

    The hand is under the first face from tick `first` on, past it from tick `crossed` on, and up to, not including,
    `end` it does nothing else. n counts the ticks of the recording.

    - `place` (N,), m: the corner, or where an edge is passed.
    - `normal_pre`, `normal_post` (N,): outward unit normals; `turn`, rad, unsigned, from one to the other.
    - `along` (n,), m: how far the hand is past the corner, square to it, along the first face.
    - `under` (n,), m: how deep it is under that face.
    - `steps` (n - 1,), m: its ways from tick to tick, without what leads a tool that rests on an edge along it.
    - `tool` (n,): where the tool is on the first face. In the plane by the IHIP, or by the force where that is all
      there is; on a solid by the rigid tool that follows the hand, whatever the renderer's does.
    - `others` (n,): where a face that is neither of the two is as near to that tool as a contact point is known, past a
      concave edge of a solid: it may be touched between two samples.
    """

    place: Array
    normal_pre: Array
    normal_post: Array
    turn: float
    first: int
    crossed: int
    end: int
    along: Array
    under: Array
    steps: Array
    tool: BoolArray
    others: BoolArray


def find_crossings(recording: Observed, *, convex: bool) -> list[Crossing]:
    """Find where the hand passes a corner as the two phenomena suppose it, whatever the renderer answers.

    - It comes under the first face from outside, through that face, or along it, or the recording begins there, and it
      stays under that face until it is past the corner.
    - Past a convex corner it is then in free space: deeper in the model the solid goes on beyond the corner, and a
      rigid tool would go round it.
    - Past a concave one it goes on under the second face, by the corner's own zone or at once.
    - In the plane all of it is nearer than half of the way to the next corner; on a mesh a rigid tool that follows the
      hand shows under which face it is.
    """
    boundary = recording.boundary
    if isinstance(boundary, Mesh):
        if convex:
            return list(_cross_convex_edges(recording, boundary, recording.rounding))
        return list(_cross_concave_edges(recording, boundary, recording.rounding, recording.position_tolerance))
    return [
        crossing
        for corner in boundary.corners
        if corner.convex == convex
        for crossing in _cross_corner(recording, corner)
    ]


def angle_between(vectors: Array, direction: Array) -> Array:
    """Return the unsigned angle (n,), rad, of each of `vectors` (n, N) to a unit `direction` (N,); of zeros 0."""
    along = vectors @ direction
    return np.asarray(np.arctan2(np.linalg.norm(vectors - along[:, np.newaxis] * direction, axis=1), along))


def _cross_corner(recording: Observed, corner: Corner) -> Iterator[Crossing]:
    """Yield the crossings of a corner in the plane, either way."""
    boundary, slack = recording.boundary, recording.rounding
    from_corner = recording.hip - corner.position
    near = np.linalg.norm(from_corner, axis=1) <= 0.5 * length_to_next_corner(boundary, corner)
    if not near.any():
        return
    # Along the boundary, anticlockwise, and against it: the faces change places.
    for heading in (1.0, -1.0):
        pre, post = (corner.normal_pre, corner.normal_post)[:: int(heading)]
        ahead, leaves = (heading * corner.tangent_pre, heading * corner.tangent_post)[:: int(heading)]
        # Coordinates of the hand in the frame of the first face, with the corner as origin.
        along, under = from_corner @ ahead, -from_corner @ pre
        # Under the first face; at a concave corner not yet in the corner's own zone.
        before = near & (along <= (0.0 if corner.convex else -slack)) & (under >= -slack)
        if corner.convex:
            free = near & (along > 0.0)
            # Beyond the corner and out of the solid; deeper a rigid tool goes round.
            free[free] = boundary.signed_distance(recording.hip[free]) > slack
            between, after = np.zeros_like(near), free
        else:
            past_post = from_corner @ leaves
            # Under the second face, past the plane through the corner that is square to it.
            after = near & (past_post > slack) & (-from_corner @ post >= -slack)
            # The corner's own zone, between the two normals: the tool rests in the corner.
            between = near & (along >= -slack) & (past_post <= slack) & ~before
        for crossed in (np.flatnonzero(after[1:] & ~after[:-1]) + 1).tolist():
            last = crossed - 1
            # Back over the corner's zone to the last tick under the first face.
            while last > 0 and between[last]:
                last -= 1
            first = last - _count_leading(before[last::-1]) + 1
            end = crossed + _count_leading(after[crossed:])
            # Shorter than a lag shows nothing of what comes after.
            if first > last or end - crossed <= LAG_TICKS:
                continue
            if _comes_from_outside(recording, boundary, first, under, pre, slack):
                turn, steps = abs(corner.turn), recording.hip_steps
                face_distance = _distance_to_face(recording, corner, heading)
                tool = face_distance <= recording.position_tolerance + recording.resolution
                if corner.convex and tool[first:crossed].any():
                    nearer = face_distance <= _distance_to_face(recording, corner, -heading)
                    if not (tool & nearer)[first:crossed].any():
                        continue  # beside the corner, and all the time on the other face
                others = np.zeros_like(tool)
                yield Crossing(corner.position, pre, post, turn, first, crossed, end, along, under, steps, tool, others)


def _distance_to_face(recording: Observed, corner: Corner, heading: float) -> Array:
    """Return how far the IHIP's nearest point of the boundary is from the face before a corner, m; (n,).

    Without an IHIP 0 where the force is along that face's normal, elsewhere infinite.
    """
    if "ihip" not in recording.channels or recording.lacks_ihip:
        normal = corner.normal_pre if heading > 0.0 else corner.normal_post
        return np.where(angle_between(recording.force, normal) <= FACE_TURN_SHARE * abs(corner.turn), 0.0, np.inf)
    boundary, within = recording.boundary, recording.position_tolerance + recording.resolution
    # Arc lengths back along the face to the corner at its other end.
    behind = [heading * (corner.s - other.s) for other in boundary.corners if other is not corner]
    if boundary.closed:
        behind = [length % boundary.girth for length in behind]
    longest = min((length for length in behind if length > 0.0), default=boundary.girth)
    face = boundary.walk(corner.position, -heading * np.linspace(0.0, longest, FACE_SAMPLES)).foot
    # A straight face needs two of these points: distances to it are then fast.
    line = shapely.simplify(shapely.LineString(face), FACE_SAMPLES_SHARE * within)
    feet = boundary.closest_point(recording.ihip).foot
    return np.asarray(shapely.distance(shapely.points(feet), line))


def _count_leading(flags: BoolArray) -> int:
    """Return how many of the first flags are true in a row."""
    return int(flags.size if flags.all() else np.argmin(flags))


def _comes_from_outside(
    recording: Observed, boundary: Boundary, first: int, under: Array, normal: Array, slack: float
) -> bool:
    """Return whether a rigid tool is on a face from tick `first` on: the hand was above it, or it is the nearest.

    `under` (n,), m, is how deep the hand is under the face, and `normal` (N,) the face's.
    """
    if first > 0 and under[first - 1] < -slack:
        return True
    at = boundary.closest_point(recording.hip[[first]])
    return bool(at.normal[0] @ normal > 1.0 - SAME_NORMAL)


def length_to_next_corner(boundary: Boundary, corner: Corner) -> float:
    """Return the arc length from a corner to the nearest other one, m; once round where it is the only one."""
    gaps = [abs(other.s - corner.s) for other in boundary.corners if other is not corner]
    return min((min(gap, boundary.girth - gap) for gap in gaps), default=boundary.girth)


def _cross_convex_edges(recording: Observed, mesh: Mesh, slack: float) -> Iterator[Crossing]:
    """Yield where a rigid tool is let go past the border of a face, with the hand still under that face's plane."""
    faces, triangles, tools = _follow_with_rigid_tool(recording, mesh, slack)
    steps = recording.hip_steps
    # On a face, and right after it free: a convex edge was passed.
    for (first, crossed, face), (_, end, after) in pairwise(_label_runs(faces)):
        if face < 0 or after != IN_FREE_SPACE:
            continue
        pre = mesh.normals[triangles[first]]
        under = (tools[first] - recording.hip) @ pre
        # The hand, drawn up into the plane of the face it was under: where it leaves that face.
        feet = recording.hip[crossed - 1 : crossed + 1] + under[crossed - 1 : crossed + 1, np.newaxis] * pre
        leaving = _leave_face(mesh, face, pre, *feet) if under[crossed] > slack else None
        if leaving is None:
            continue
        place, ahead, post = leaving
        along = (recording.hip - place) @ ahead
        # Past the edge and out of the solid, as in the plane.
        free = (along > 0.0) & (faces == IN_FREE_SPACE)
        free[crossed:end] &= mesh.signed_distance(recording.hip[crossed:end]) > slack
        end = crossed + _count_leading(free[crossed:end])
        if end - crossed > LAG_TICKS:
            turn = float(angle_between(post[np.newaxis], pre)[0])
            tool = faces == face
            others = np.zeros_like(tool)  # which this is not asked for
            yield Crossing(place, pre, post, turn, first, crossed, end, along, under, steps, tool, others)


def _cross_concave_edges(recording: Observed, mesh: Mesh, slack: float, within: float) -> Iterator[Crossing]:
    """Yield where a rigid tool goes from one face to another that rises from it: by an edge, or a corner of three."""
    faces, triangles, tools = _follow_with_rigid_tool(recording, mesh, slack)
    hip_motions, tool_motions = np.diff(recording.hip, axis=0), np.diff(tools, axis=0)
    stretches = _label_runs(faces)
    for number, (first, last, face) in enumerate(stretches[:-1]):
        # By way of the edge, where the tool rests, or at once.
        rested = stretches[number + 1][2] == TOOL_RESTS
        next_number = number + 1 + rested
        if face < 0 or next_number >= len(stretches):
            continue
        crossed, end, other = stretches[next_number]
        if other < 0 or other == face or end - crossed <= LAG_TICKS:
            continue
        pre, post = mesh.normals[triangles[first]], mesh.normals[triangles[crossed]]
        # Seen from a concave edge each face lies on the outer side of the other; a tool does not rest on a convex one.
        rise, least_rise = tools[crossed] - tools[last - 1], -slack if rested else slack
        if min(rise @ pre, -rise @ post) > least_rise:
            turn = float(angle_between(post[np.newaxis], pre)[0])
            under = (tools[first] - recording.hip) @ pre
            along = np.zeros(len(recording))  # of what is left at an edge, which this is not asked for
            # The tool may slide along the edge, resting on it or from one face to the other: no part of a switch.
            edge = np.cross(pre, post) / np.linalg.norm(np.cross(pre, post))
            steps = np.linalg.norm(hip_motions - (tool_motions @ edge)[:, np.newaxis] * edge, axis=1)
            others = _find_others(mesh, tools, range(first, end), (pre, post), within)
            place, tool = tools[crossed], faces == face
            yield Crossing(place, pre, post, turn, first, crossed, end, along, under, steps, tool, others)


def _follow_with_rigid_tool(recording: Observed, mesh: Mesh, slack: float) -> tuple[IntArray, IntArray, Array]:
    """Return the flat face of the mesh (n,) that a rigid tool is on, its triangle (n,), and its place (n, 3), m.

    In place of a face it is `IN_FREE_SPACE`, `TOOL_RESTS` or `UNDECIDED`. On an edge or a vertex in the middle of a
    flat face the tool is on that face.

    A hand that is on the mesh, to `slack` (m), is on either side of it by rounding. The tool is that of a hand a little
    inside, under all faces there: the hand of a rigid contact is the tool, and is so held. Where a hand a little
    outside has a tool elsewhere, on another face or free, nothing tells which is right: the hand has come over an edge
    in a face's plane. Nor does anything later, as long as the tools of both go on to be apart.
    """
    inside, outside = shift_touching(recording.hip, mesh, slack)
    triangles, faces, tools = _find_faces(mesh, inside)
    if outside is not inside:
        _, other_faces, other_tools = _find_faces(mesh, outside)
        unclear = _differ(faces, tools, other_faces, other_tools, slack)
        # From where it is clear again, the hand is inside: but the tool stays on the face that either side has led to.
        for _, end in runs_of(unclear):
            if end < len(faces) and faces[end] >= 0:
                _, other_faces, other_tools = _find_faces(mesh, np.vstack([outside[:end], inside[end:]]))
                unclear |= _differ(faces, tools, other_faces, other_tools, slack)
        faces[unclear] = UNDECIDED
    return faces, triangles, tools


def _find_others(mesh: Mesh, tools: Array, ticks: range, normals: tuple[Array, Array], within: float) -> BoolArray:
    """Return where (n,) a face with another normal than these is `within` (m) of a tool (n, 3), m, at these ticks."""
    others = np.zeros(len(tools), dtype=bool)
    starts, around = normals_in_reach(*mesh.tables, tools[ticks], np.full(len(ticks), within))
    differs = np.all([np.linalg.norm(around - normal, axis=1) > SAME_NORMAL for normal in normals], axis=0)
    # each tick has the face that it is on
    others[ticks] = np.logical_or.reduceat(differs, starts[:-1])
    return others


def _differ(faces: IntArray, tools: Array, other_faces: IntArray, other_tools: Array, slack: float) -> BoolArray:
    """Return where a tool (n, 3), m, is on a face (n,), and another elsewhere by more than rounding, `slack` (m)."""
    apart = np.linalg.norm(tools - other_tools, axis=1) > SHIFTED_TOOLS_APART * slack
    return np.asarray((faces >= 0) & (faces != other_faces) & apart)


def _find_faces(mesh: Mesh, hips: Array) -> tuple[IntArray, IntArray, Array]:
    """Return a rigid tool's triangles (n,), its faces (n,), or what stands in their place, and its places (n, 3), m."""
    triangles, features, tools = mesh.rigid_tool(hips)
    faces = mesh.facets[triangles]
    corners, vertices, across = mesh.triangles, mesh.tables[1], mesh.neighbours
    # On an edge or a vertex; flat where its normal is that of the face.
    for tick in np.flatnonzero(features > FACE).tolist():
        triangle, feature = int(triangles[tick]), int(features[tick])
        if feature < VERTEX:
            flat = mesh.facets[across[triangle, feature - EDGE]] == faces[tick]
        else:
            mean = vertices[corners[triangle, feature - VERTEX], PSEUDO:]
            flat = bool(np.linalg.norm(mean - mesh.normals[triangle]) <= SAME_NORMAL)
        if not flat:
            faces[tick] = TOOL_RESTS
    faces[features == IN_FREE_SPACE] = IN_FREE_SPACE
    return triangles, faces, tools


def shift_touching(hips: Array, mesh: Mesh, slack: float) -> tuple[Array, Array]:
    """Return `hips` (n, 3), m, with those that are on the mesh, to `slack` (m), a little inside, and a little outside.

    Inside is under all faces there: on a concave edge, and in a corner, a tool that follows the hand then rests. Both
    are `hips` itself where none is on the mesh.
    """
    touching = np.flatnonzero(np.abs(mesh.signed_distance(hips)) <= slack)
    if touching.size == 0:
        return hips, hips
    inside, outside = np.array(hips), np.array(hips)
    starts, normals = normals_in_reach(*mesh.tables, hips[touching], np.full(touching.size, slack))
    for row, tick in enumerate(touching.tolist()):
        outwards = normals[starts[row] : starts[row + 1]].sum(axis=0)
        shift = 2.0 * slack * outwards / np.linalg.norm(outwards)
        inside[tick] -= shift
        outside[tick] += shift
    return inside, outside


def _label_runs(labels: IntArray) -> list[tuple[int, int, int]]:
    """Return the stretches of equal labels: first row, the row after the last, label."""
    cuts = [0, *(np.flatnonzero(np.diff(labels)) + 1).tolist(), labels.size]
    return [(first, end, int(labels[first])) for first, end in pairwise(cuts)]


def _leave_face(mesh: Mesh, face: int, normal: Array, start: Array, end: Array) -> tuple[Array, Array, Array] | None:
    """Return where a way in the plane of a face, from `start` on it to `end`, leaves it; None where it does not.

    As the place (3,), m, the direction (3,) out of the face square to its border there, and the normal (3,) beyond.
    """
    rows = np.flatnonzero(mesh.facets == face)
    triangles, i = np.repeat(rows, 3), np.tile(np.arange(3), rows.size)
    neighbours = mesh.neighbours[triangles, i]
    border = mesh.facets[neighbours] != face
    triangles, i, neighbours = triangles[border], i[border], neighbours[border]
    a, b = mesh.vertices[mesh.triangles[triangles, i]], mesh.vertices[mesh.triangles[triangles, (i + 1) % 3]]
    lengths = np.linalg.norm(b - a, axis=1)
    edge_directions = (b - a) / lengths[:, np.newaxis]
    # Square to each border edge, out of the face: signed distances of start and end from the edge.
    outward = np.cross(edge_directions, normal)
    before, after = np.sum(outward * (start - a), axis=1), np.sum(outward * (end - a), axis=1)
    crosses = np.flatnonzero((after > 0.0) & (before < after))
    # before (1 - s) + after s = 0, within the step
    share = np.clip(before[crosses] / (before[crosses] - after[crosses]), 0.0, 1.0)
    places = start + share[:, np.newaxis] * (end - start)
    # How far the crossing lies along the edge; beyond its ends it misses it.
    along = np.sum(edge_directions[crosses] * (places - a[crosses]), axis=1)
    misses = np.maximum(np.maximum(-along, along - lengths[crosses]), np.maximum(before[crosses], 0.0))
    if not misses.size or misses.min() > BORDER_MISS * float(np.linalg.norm(end - start)) + BORDER_ROUNDING:
        return None
    best = int(np.argmin(misses))
    return places[best], outward[crosses[best]], mesh.normals[neighbours[crosses[best]]]


def worst_finding(findings: Sequence[Finding]) -> Finding | None:
    """Return the finding whose metric is farthest beyond its bound, the first of equally bad ones; None of none."""
    if not findings:
        return None
    return worst_of(findings, lambda finding: math.inf if finding.margin is None else -finding.margin)
