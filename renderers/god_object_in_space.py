"""The constraint projection (4.3) on a triangle mesh: the tool slides over faces, along edges and into corners.

As in the plane (see `god_object`) the tool

- starts a contact where the hand's motion first goes inside;
- rests where no motion on the mesh leads closer to the hand;
- is released where the hand is free: on a face when it is outside of its plane, at a convex edge of one of the two
  planes, at a concave one of both.
"""

from __future__ import annotations

from hapticeval.compiled import LawData, compiled
from hapticeval.geometry.mesh import Mesh
from hapticeval.geometry.mesh_kernels import closest_feature, closest_on_mesh, side_and_normal
from hapticeval.geometry.mesh_tool import RESTS, fly_to_hand, walk_downhill
from hapticeval.renderers.law import BILATERAL, ERROR, OWN, ROOM, regulate, release
from hapticeval.renderers.projective import CompiledProjection
from hapticeval.scene import Scene
from hapticeval.types import Array

TOUCHES, TRIANGLE, FEATURE, TOOL, HIP = ROOM[3], ROOM[3] + 1, ROOM[3] + 2, ROOM[3] + 3, ROOM[3] + 6
"""In `state`: whether the tool is in contact, on which feature of which triangle, where, and the last HIP.

In free space the triangle is one close to the hand, where the search begins.
"""

TOUCH = OWN
"""In `params`: the mesh's `touch` (m)."""


def on_mesh(scene: Scene, mesh: Mesh) -> CompiledProjection:
    """Return the projection; whether the tool is ever released, and how a run starts, is as in the plane."""
    faces, vertices, tree = mesh.tables
    return CompiledProjection(
        follow,
        mesh,
        bilateral=scene.bilateral,
        own=[mesh.touch],
        memory=9,
        begin=begin,
        segments=faces,
        vertices=vertices,
        tree=tree,
    )


@compiled
def begin(data: LawData, hip: Array) -> None:
    """Put the tool where a run starts with the hand at `hip` (3,), m: if that is inside, on the nearest point."""
    faces, vertices, tree, state = data.segments, data.vertices, data.tree, data.state
    hand = (hip[0], hip[1], hip[2])
    triangle, feature, foot = closest_feature(faces, vertices, tree, hand, 0)
    _, _, _, distance = closest_on_mesh(faces, vertices, tree, hand, triangle)
    state[TOUCHES] = 1.0 if data.params[BILATERAL] != 0.0 or distance < 0.0 else 0.0
    state[TRIANGLE], state[FEATURE] = triangle, feature
    for i in range(3):
        state[TOOL + i], state[HIP + i] = foot[i], hip[i]


@compiled
def follow(
    data: LawData, hip: Array, velocity: Array, push: Array, dt: float, ihip: Array, force: Array  # noqa: ARG001
) -> int:  # fmt: skip
    """One tick of the constraint projection (4.3), of signature `LAW`: from the last IHIP, or the last HIP if free.

    `hip` (3,), m, and `velocity` (3,), m/s, are the hand's; `ihip` (3,), m, and `force` (3,), N, are written.
    """
    faces, vertices, params, state = data.segments, data.vertices, data.params, data.state
    hand, triangle, feature = (hip[0], hip[1], hip[2]), int(state[TRIANGLE]), int(state[FEATURE])
    tool = (state[TOOL], state[TOOL + 1], state[TOOL + 2])
    touches = state[TOUCHES] != 0.0
    rests = False
    if touches:  # over faces, along edges and into corners, downhill in distance
        status, triangle, feature, tool = walk_downhill(
            faces, vertices, params[BILATERAL] == 0.0, triangle, feature, tool, hand
        )
        rests = status == RESTS
    if not rests:  # free, or released just now: straight to the hand
        start = tool if touches else (state[HIP], state[HIP + 1], state[HIP + 2])
        touches, triangle, feature, tool = fly_to_hand(faces, vertices, data.tree, params[TOUCH], start, hand, triangle)
    state[TOUCHES], state[TRIANGLE], state[FEATURE] = 1.0 if touches else 0.0, triangle, feature
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
