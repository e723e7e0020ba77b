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

from hapticeval.compiled import borrowing, compiled, inner
from hapticeval.geometry.kernels import LEAVES, RESTS
from hapticeval.geometry.mesh import Mesh
from hapticeval.geometry.mesh_kernels import closest_feature, closest_on_mesh, side_and_normal
from hapticeval.geometry.mesh_tool import fly_to_hand, walk_downhill
from hapticeval.geometry.model import VERTICES
from hapticeval.laws import LawData
from hapticeval.records import as_record, record_type
from hapticeval.renderers.outline import (
    Outline,
    evaluate_at,
    first_entry,
    frame,
    nearest_on,
    outline_in,
    representation_of,
    slide,
)
from hapticeval.renderers.projective import Projection
from hapticeval.renderers.regulation_kernel import GAINS, PAST, regulate, release
from hapticeval.scene import Scene
from hapticeval.types import Array

PROXY = record_type("touches", "piece", "u", base=PAST, hip=2)
"""The `state`: with whether the tool is in contact, where on which piece, and the last HIP (m)."""

FLIGHTS = 64
"""Releases within one tick after which the side of the hand decides; each brings the tool closer to it."""


def god_object(scene: Scene, representation: str, *, vertices: float = VERTICES) -> Projection:
    """Return the constraint projection on a polygon or a curve, or on a triangle mesh, which is its own polygon.

    A run that starts with the hand inside starts in contact at the nearest surface point. In a bilateral scene the tool
    is never released: it follows the same local minimum of the distance with the hand on either side.
    """
    if isinstance(scene.model.boundary, Mesh):
        return on_mesh(scene, scene.model.boundary)
    shape = representation_of(scene.model, representation, int(vertices))
    return Projection(follow, shape.surface, bilateral=scene.bilateral, state=PROXY, begin=begin, **shape.tables)


@borrowing
def begin(data: LawData, hip: Array) -> None:
    """Put the tool where a run starts with the hand at `hip` (2,), m: if that is inside, on the nearest point."""
    tool = as_record(data.state, PROXY)
    piece, u, _, side = nearest_on(outline_in(data), hip[0], hip[1])
    tool.touches = 1.0 if as_record(data.params, GAINS).bilateral != 0.0 or side < 0.0 else 0.0
    tool.piece, tool.u, tool.hip[0], tool.hip[1] = piece, u, hip[0], hip[1]


@inner
def follow(
    data: LawData, hip: Array, velocity: Array, push: Array, dt: float, ihip: Array, force: Array  # noqa: ARG001
) -> int:  # fmt: skip
    """One tick of the constraint projection (4.3), of signature `LAW`: from the last IHIP, or the last HIP if free.

    `hip` (2,), m, and `velocity` (2,), m/s, are the hand's; `ihip` (2,), m, and `force` (2,), N, are written.
    """
    outline, params, state, tool = outline_in(data), data.params, data.state, as_record(data.state, PROXY)
    x, y = hip[0], hip[1]
    touches, piece, u = tool.touches != 0.0, int(tool.piece), tool.u
    status = LEAVES
    if touches:  # downhill in distance, from where the tool is
        status, piece, u = slide(
            outline.pieces, outline.joins, as_record(params, GAINS).bilateral == 0.0, piece, u, x, y
        )
    if status == LEAVES:  # free, or released just now: straight to the hand
        x0, y0 = tool.hip[0], tool.hip[1]
        if touches:
            x0, y0, _, _, _, _ = evaluate_at(outline.pieces, piece, u)
        touches, piece, u = _fly(outline, touches, x0, y0, x, y)
        tool.touches = 1.0 if touches else 0.0
    # the next tick goes on from here
    tool.piece, tool.u, tool.hip[0], tool.hip[1] = piece, u, x, y
    if not touches:
        return release(state, hip, ihip, force)
    ihip[0], ihip[1], tool.normal[0], tool.normal[1] = frame(outline.pieces, outline.joins, piece, u, x, y)
    return regulate(params, state, hip, velocity, 0.0, 0.0, dt, ihip, force)


@borrowing
def _fly(outline: Outline, released: bool, x0: float, y0: float, x: float, y: float) -> tuple[bool, int, float]:
    """Straight to the hand at (x, y) from (x0, y0), where the tool was `released` from the surface or is free.

    Returns whether the tool runs into something on the way, and the (piece, u) at which it then comes to rest.
    """
    for _flight in range(FLIGHTS):
        touches, piece, u = first_entry(outline, x0, y0, x, y, released)
        if not touches:
            return False, piece, u
        # a new contact: slide on from there, and off again where a corner lets it
        status, piece, u = slide(outline.pieces, outline.joins, True, piece, u, x, y)
        if status != LEAVES:
            return True, piece, u
        released = True
        x0, y0, _, _, _, _ = evaluate_at(outline.pieces, piece, u)
    # in a fold that throws it to and fro the side of the hand decides
    piece, u, _, side = nearest_on(outline, x, y)
    return side < 0.0, piece, u


MESH_TOOL = record_type("touches", "triangle", "feature", base=PAST, place=3, hip=3)
"""The `state` on a mesh: with whether the tool is in contact, on which feature of which triangle, where, and the last
HIP (m).

In free space the triangle is one close to the hand, where the search begins.
"""

MESH_GAINS = record_type("touch", base=GAINS)
"""The `params` on a mesh: with its `touch` (m)."""


def on_mesh(scene: Scene, mesh: Mesh) -> Projection:
    """Return the projection; whether the tool is ever released, and how a run starts, is as in the plane."""
    faces, vertices, tree = mesh.tables
    return Projection(
        follow_on_mesh,
        mesh,
        bilateral=scene.bilateral,
        own=[mesh.touch],
        state=MESH_TOOL,
        begin=begin_on_mesh,
        pieces=faces,
        vertices=vertices,
        tree=tree,
    )


@compiled
def begin_on_mesh(data: LawData, hip: Array) -> None:
    """Put the tool where a run starts with the hand at `hip` (3,), m: if that is inside, on the nearest point."""
    faces, vertices, tree, tool = data.pieces, data.vertices, data.tree, as_record(data.state, MESH_TOOL)
    hand = (hip[0], hip[1], hip[2])
    triangle, feature, foot = closest_feature(faces, vertices, tree, hand, 0)
    _, _, _, distance = closest_on_mesh(faces, vertices, tree, hand, triangle)
    tool.touches = 1.0 if as_record(data.params, GAINS).bilateral != 0.0 or distance < 0.0 else 0.0
    tool.triangle, tool.feature = triangle, feature
    for i in range(3):
        tool.place[i], tool.hip[i] = foot[i], hip[i]


@compiled
def follow_on_mesh(
    data: LawData, hip: Array, velocity: Array, push: Array, dt: float, ihip: Array, force: Array  # noqa: ARG001
) -> int:  # fmt: skip
    """One tick of the constraint projection (4.3), of signature `LAW`: from the last IHIP, or the last HIP if free.

    `hip` (3,), m, and `velocity` (3,), m/s, are the hand's; `ihip` (3,), m, and `force` (3,), N, are written.
    """
    faces, vertices, params, state = data.pieces, data.vertices, data.params, data.state
    gains, tool = as_record(params, MESH_GAINS), as_record(state, MESH_TOOL)
    hand, triangle, feature = (hip[0], hip[1], hip[2]), int(tool.triangle), int(tool.feature)
    place = (tool.place[0], tool.place[1], tool.place[2])
    touches = tool.touches != 0.0
    rests = False
    if touches:  # over faces, along edges and into corners, downhill in distance
        status, triangle, feature, place = walk_downhill(
            faces, vertices, gains.bilateral == 0.0, triangle, feature, place, hand
        )
        rests = status == RESTS
    if not rests:  # free, or released just now: straight to the hand
        start = place if touches else (tool.hip[0], tool.hip[1], tool.hip[2])
        touches, triangle, feature, place = fly_to_hand(faces, vertices, data.tree, gains.touch, start, hand, triangle)
    tool.touches, tool.triangle, tool.feature = 1.0 if touches else 0.0, triangle, feature
    for i in range(3):
        tool.place[i], tool.hip[i] = place[i], hip[i]
    if not touches:
        return release(state, hip, ihip, force)
    # on an edge or at a corner the normal is along the error
    tool_to_hand = (hip[0] - place[0], hip[1] - place[1], hip[2] - place[2])
    _, normal = side_and_normal(faces, vertices, triangle, feature, place, tool_to_hand)
    for i in range(3):
        ihip[i], tool.normal[i] = place[i], normal[i]
    return regulate(params, state, hip, velocity, 0.0, 0.0, dt, ihip, force)
