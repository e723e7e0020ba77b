"""A triangle mesh under the ideal contact: where the tool starts, and how it goes from event to event between samples.

On a flat face the tool slides, along a concave edge it slides held by both faces, and in a corner it rests. All three
are a flight of which the contact takes the parts along the normals, so that each is in closed form.

An impact takes its impulse from one normal after the other (thesis (3.5)) until the velocity leads out of the solid:

- the normal of the face through which that is nearest; at a convex edge or corner this is the least of the impulses
  that free the tool;
- in a concave edge or corner that of the face which the velocity runs against most, as in the plane. Between faces at
  right angles the order makes no difference, nor without restitution between two at an acute one. Else it is a choice.

A hop that stays within HOP_SHARE of the size of where it began is taken as contact: the tool slides or rests.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from hapticeval.compiled import compiled
from hapticeval.errors import RefusalError
from hapticeval.geometry.mesh import Mesh
from hapticeval.geometry.mesh_kernels import EDGE, FACE, VERTEX, closest_feature, corner_of, neighbour_of, normal_of
from hapticeval.geometry.triples import Triple, cross, dot, minus, plus, put_triple, scaled, triple_of
from hapticeval.records import as_record
from hapticeval.rigid_contact.contact import ON_BOUNDARY
from hapticeval.rigid_contact.force import (
    ALIGNED_SHARE,
    FLIGHT,
    IMPACT,
    LEAVE,
    LOAD,
    MOST_CORNER_HITS,
    MOST_SAMPLE_STEPS,
    PLACE_REACH,
    REST,
    SLIDE,
    STOP,
    Stretches,
    longest_flight_step,
)
from hapticeval.rigid_contact.force import CORNER as AT_CORNER
from hapticeval.rigid_contact.mesh_search import ToolPath, first_edge, first_entry, first_fall, follow
from hapticeval.rigid_contact.mesh_terrain import (
    MeshTerrain,
    edge_direction,
    feature_at,
    height_over_face,
    most_opposed_normal,
    nearest_around,
    next_in_fan,
    prepare_mesh,
    pulls_into,
)
from hapticeval.rigid_contact.space import (
    SPACE_TOOL,
    Tool,
    begin_stretch,
    close_sample,
    force_in_space,
    log_in_space,
    move_tool,
    state_in_flight,
    strike_tool,
    where_given_up,
)
from hapticeval.scene import Scene
from hapticeval.types import Array, IntArray

NOWHERE = (0.0, 0.0, 0.0)


@compiled
def meet(terrain: MeshTerrain, tool: Tool, tau: float, kind: int) -> None:
    """Let the tool, with the velocity that it has, meet the place that it is at, `tau` (s) into the stretch.

    Impulses free it, an event of this kind tells of them, and what it does then follows from velocity and force.
    """
    state, load = tool.state, tool.load
    k, feature = int(state.triangle), int(state.feature)
    mass, rebound, p, v = load.mass, load.restitution, triple_of(state.position), triple_of(state.velocity)
    # normal velocities below this are rounding, and below a thousand of it the tool is at rest
    rounding = ALIGNED_SHARE * math.sqrt(dot(v, v))
    rest_speed = 1e3 * rounding
    hits = 0
    while True:
        depth, face, nearest, _ = nearest_around(terrain, k, feature, v)
        if depth >= -rounding or dot(v, v) <= rest_speed * rest_speed:
            break
        # each hit of so many took speed: none is left
        if hits == MOST_CORNER_HITS:
            v = v if rebound == 1.0 else NOWHERE
            break
        hits += 1
        normal = most_opposed_normal(terrain, face, nearest, v)
        across = dot(normal, v)
        # (3.5) on that face
        v, bounce = plus(v, -across, normal), -rebound * across
        contact = -dot(force_in_space(load, tau, p, v), normal)
        # a bounce that the force ends within a hop that is contact, of height m u^2 / (2 N), is left out
        if contact <= 0.0 or mass * bounce * bounce >= 2.0 * contact * load.hop:
            v = plus(v, bounce, normal)
    if dot(v, v) <= rest_speed * rest_speed:
        v = NOWHERE
    if feature != FACE:
        v = _without_hops(terrain, k, feature, v, force_in_space(load, tau, p, v), load)
    impulse = strike_tool(tool, v)
    if hits > 0:
        log_in_space(tool, kind, tau, impulse)
    settle(terrain, tool, tau)


@compiled
def _without_hops(terrain: MeshTerrain, k: int, feature: int, v: Triple, force: Triple, load: Any) -> Triple:
    """Return a velocity (m/s) without the part whose hops a force (N) ends too soon for a `load` to be hops.

    Hops that are contact are m u^2 / (2 F) high, where the force pulls back least; where it does so most, they are
    nothing to the rounding of positions.
    """
    weakest, strongest = pulls_into(terrain, k, feature, force)
    energy = max(weakest * load.hop, strongest * load.rounding)
    if feature >= VERTEX:
        return NOWHERE if weakest > 0.0 and load.mass * dot(v, v) < 2.0 * energy else v
    if terrain.turns[k, feature - EDGE] >= 0.0:
        return v
    e = edge_direction(terrain.faces, terrain.vertices, k, feature - EDGE)
    # what is along the edge stays; what is square to it is left out
    along = scaled(dot(v, e), e)
    aside = minus(v, along)
    return along if weakest > 0.0 and load.mass * dot(aside, aside) < 2.0 * energy else v


@compiled
def settle(terrain: MeshTerrain, tool: Tool, tau: float) -> None:
    """Let the tool at its place do what velocity and force (N), `tau` (s) into the stretch, lead it to.

    It flies off where the velocity, or else the force, leads out of the solid. Otherwise it goes on along the boundary
    that is closest to the velocity, or if it is at rest to the force, and of this that which is closest to the force.
    """
    state = tool.state
    k, feature, mode = int(state.triangle), int(state.feature), state.mode
    p, v = triple_of(state.position), triple_of(state.velocity)
    if dot(v, v) > 0.0:
        speed = math.sqrt(dot(v, v))
        height, k, feature, v = nearest_around(terrain, k, feature, v)
        if height > ALIGNED_SHARE * speed:
            let_go(tool, tau)
            return
        strike_tool(tool, v)
    # of that boundary, feature of k, what is closest to the force
    force = force_in_space(tool.load, tau, p, v)
    height, j, nearest, _ = nearest_around(terrain, k, feature, force)
    if height > 0.0 and (feature == FACE or height > ALIGNED_SHARE * math.sqrt(dot(force, force))):
        let_go(tool, tau)
        return
    # on a convex edge it goes along either face
    if EDGE <= nearest < VERTEX and terrain.turns[j, nearest - EDGE] > 0.0:
        nearest = FACE
    state.mode = REST if nearest >= VERTEX else SLIDE
    state.triangle, state.feature = j, nearest
    if state.mode == REST and mode != REST:
        log_in_space(tool, STOP, tau, NOWHERE)


@compiled
def let_go(tool: Tool, tau: float) -> None:
    """Let the tool fly from where it is, and log that it left if it was in contact."""
    if tool.state.mode != FLIGHT:
        log_in_space(tool, LEAVE, tau, NOWHERE)
    tool.state.mode = FLIGHT


@compiled
def reach_place(terrain: MeshTerrain, tool: Tool, k: int, convex_reach: float) -> None:
    """Put the tool on the feature of triangle k that it has come to, within a hop, or `convex_reach` (m) if convex."""
    feature, foot = feature_at(terrain, k, triple_of(tool.state.position), PLACE_REACH, convex_reach)
    put_triple(tool.state.position, 0, foot)
    tool.state.triangle, tool.state.feature = k, feature


@compiled
def advance_flight(
    terrain: MeshTerrain, tool: Tool, tau: float, time_left: float, free: Array, near: IntArray
) -> float:
    """Carry a flying tool by one step of at most `time_left` (s), from `tau` (s) on, and return how long it took.

    `free` (6,), m, and `near` (t,) as in `first_entry`.
    """
    load, state = tool.load, tool.state
    h = longest_flight_step(load, time_left)
    path = ToolPath(triple_of(state.position), triple_of(state.velocity), tau, NOWHERE)
    time, k, _ = first_entry(terrain, path, h, load, free, near)
    h = min(time, h)
    p, v = follow(path, h, load)
    move_tool(tool, p, v, NOWHERE)
    if k >= 0:
        # a convex edge is hit only by what falls on neither of its faces
        reach_place(terrain, tool, k, 0.0)
        meet(terrain, tool, tau + h, IMPACT)
    return h


@compiled
def advance_on_face(terrain: MeshTerrain, tool: Tool, tau: float, time_left: float, near: IntArray) -> float:
    """Carry a tool that slides on a flat face by one step of at most `time_left` (s), and return how long it took.

    The step begins `tau` (s) into the stretch; `near` (t,) is room for triangles that come near.
    """
    load, state = tool.load, tool.state
    k = int(state.triangle)
    normal, p, v = normal_of(terrain.faces, k), triple_of(state.position), triple_of(state.velocity)
    # N = -F.n is linear in time: along the normal the spring's stretch stays, and the damper does nothing
    contact, rate = -dot(force_in_space(load, tau, p, v), normal), -dot(triple_of(load.g1), normal)
    if contact < 0.0:
        let_go(tool, tau)
        return 0.0
    h = longest_flight_step(load, time_left)
    # N reaches zero within the step: the tool lifts off there
    lifts = contact + rate * h < 0.0
    if lifts:
        h = contact / -rate
    path = ToolPath(p, v, tau, normal)
    time, edge_triangle, _ = first_edge(terrain, k, path, h, load, near)
    h = min(time, h)
    p, v = follow(path, h, load)
    # back onto the plane, by rounding
    p = plus(p, -height_over_face(terrain, k, p), normal)
    # the contact's impulse: N integrated over the step, h (N + N' h / 2)
    move_tool(tool, p, v, scaled(h * (contact + 0.5 * rate * h), normal))
    if edge_triangle >= 0:
        reach_place(terrain, tool, edge_triangle, PLACE_REACH)
        meet(terrain, tool, tau + h, AT_CORNER)
    elif lifts:
        let_go(tool, tau + h)
    return h


@compiled
def advance_on_edge(terrain: MeshTerrain, tool: Tool, tau: float, time_left: float) -> float:
    """Carry a tool that slides along a concave edge by one step of at most `time_left` (s); return how long it took.

    The step begins `tau` (s) into the stretch.
    """
    load, state = tool.load, tool.state
    k, i = int(state.triangle), int(state.feature) - EDGE
    j, e = neighbour_of(terrain.faces, k, i), edge_direction(terrain.faces, terrain.vertices, k, i)
    p, v = triple_of(state.position), triple_of(state.velocity)
    force, rate = force_in_space(load, tau, p, v), triple_of(load.g1)
    h, onto = longest_flight_step(load, time_left), -1
    # where the force comes to drive it up a face, the other's multiplier is zero: linear in time, as on a face
    for face in (k, j):
        up = cross(normal_of(terrain.faces, k), e) if face == k else cross(e, normal_of(terrain.faces, j))
        drive, growth = dot(up, force), dot(up, rate)
        if drive > 0.0:
            h, onto = 0.0, face
        elif drive + growth * h > 0.0:
            h, onto = -drive / growth, face
    path = ToolPath(p, v, tau, NOWHERE)
    a, b = (
        corner_of(terrain.faces, terrain.vertices, k, i),
        corner_of(terrain.faces, terrain.vertices, k, (i + 1) % 3),
    )
    # past either end
    end = VERTEX + i
    time = first_fall(e, a, path, 0.0, h, load.rounding, load)
    other = first_fall(scaled(-1.0, e), b, path, 0.0, min(time, h), load.rounding, load)
    if other < time:
        time, end = other, VERTEX + (i + 1) % 3
    ends = time <= h
    h = min(time, h)
    p, v = follow(path, h, load)
    # of the flight what is along the edge: the spring is the same on all axes, so that this moves as if alone
    p, v = plus(a, dot(minus(p, a), e), e), scaled(dot(v, e), e)
    # both contacts take what of the force is square to the edge, linear in time
    mean = plus(force, 0.5 * h, rate)
    move_tool(tool, p, v, scaled(-h, plus(mean, -dot(mean, e), e)))
    if ends:
        state.feature = end
        put_triple(state.position, 0, a if end == VERTEX + i else b)
        meet(terrain, tool, tau + h, AT_CORNER)
    elif onto >= 0:
        state.triangle, state.feature = onto, FACE
    return h


@compiled
def advance_at_rest(terrain: MeshTerrain, tool: Tool, tau: float, time_left: float) -> float:
    """Let the tool rest in a corner, for `time_left` (s) at most, until the force drives it out; return how long.

    It is driven out along the edge along which the force, linear in time, first does not hold it. The step begins `tau`
    (s) into the stretch.
    """
    load, state = tool.load, tool.state
    k, i = int(state.triangle), int(state.feature) - VERTEX
    p = triple_of(state.position)
    force, rate = force_in_space(load, tau, p, NOWHERE), triple_of(load.g1)
    h, exit_triangle, edge = time_left, -1, 0
    j, corner = k, i
    while True:
        e = edge_direction(terrain.faces, terrain.vertices, j, corner)
        drive, growth = dot(e, force), dot(e, rate)
        if drive > 0.0:
            h, exit_triangle, edge = 0.0, j, corner
        # e.(F + F' t) = 0
        elif drive + growth * h > 0.0:
            h, exit_triangle, edge = -drive / growth, j, corner
        j, corner = next_in_fan(terrain, j, corner)
        if j == k:
            break
    # three contacts or more take all of the force
    move_tool(tool, p, NOWHERE, scaled(-h, plus(force, 0.5 * h, rate)))
    if exit_triangle >= 0:
        # an edge within a flat face is that face
        state.triangle = exit_triangle
        state.feature = FACE if terrain.turns[exit_triangle, edge] == 0.0 else EDGE + edge
        settle(terrain, tool, tau + h)
    return h


@compiled
def carry_on_mesh(
    start: Array, terrain: MeshTerrain, stretches: Stretches, gains: Array, rows: int, limit: int
) -> tuple[Array, Array, int, Array]:
    """Carry the tool from `start`, SLIDE where it begins on the mesh, through all stretches, see `Ground.carry`.

    `start` (k,) and `gains` (k,) are changed: the numbers (m, m/s, N, s) of a `SPACE_TOOL`, and of a `LOAD` with its
    constants filled in.
    """
    state, out = as_record(start, SPACE_TOOL), np.zeros((rows, 12))
    tool = Tool(state, as_record(gains, LOAD), np.zeros(6), np.zeros((limit, 8)), np.zeros(1, np.int64))
    # inside out: no box is known to be free yet
    free = np.array([math.inf, math.inf, math.inf, -math.inf, -math.inf, -math.inf])
    near, last = np.empty(terrain.faces.shape[0], np.int64), stretches.began.shape[0] - 1
    for i in range(last + 1):
        begin_stretch(tool, stretches, i, out)
        if i == 0 and state.mode == SLIDE:
            meet(terrain, tool, 0.0, IMPACT)
        tau, length, steps = 0.0, stretches.lasts[i], 0
        while tau < length and tool.tally[0] <= limit:
            time_left = length - tau
            if state.mode == FLIGHT:
                h = advance_flight(terrain, tool, tau, time_left, free, near)
            elif state.mode == REST:
                h = advance_at_rest(terrain, tool, tau, time_left)
            elif state.feature == FACE:
                h = advance_on_face(terrain, tool, tau, time_left, near)
            else:
                h = advance_on_edge(terrain, tool, tau, time_left)
            steps += 1
            if steps > MOST_SAMPLE_STEPS:
                return out, tool.log, int(tool.tally[0]), where_given_up(tool, tau)
            # to the end of the stretch, by rounding too
            if h >= time_left:
                break
            tau += h
    close_sample(tool, stretches, last, out)
    return out, tool.log, int(tool.tally[0]), np.empty(0)


class MeshGround:
    """A triangle mesh as the `Ground` of an ideal contact: flat faces, edges and corners, unilateral.

    Raises `RefusalError` for a bilateral scene.
    """

    def __init__(self, scene: Scene) -> None:
        boundary = scene.model.boundary
        assert isinstance(boundary, Mesh)
        if scene.bilateral:
            raise RefusalError(
                f"the mesh '{scene.model.name}' holds the tool from both sides",
                why="a tool that is held loses its velocity across the next face at every convex edge, and in a corner "
                "it has no next face",
                todo="compare on a smooth surface, or in the plane",
            )
        self._mesh = boundary
        self._terrain = prepare_mesh(boundary)

    def in_flight(self, point: Array, velocity: Array) -> Array:
        """Answer `Ground.in_flight` for a point (3,), m, and a velocity (3,), m/s."""
        # its triangle and feature are those of its first hit: none is read before
        return state_in_flight(point, velocity)

    def on_boundary(self, point: Array, velocity: Array) -> Array:
        """Answer `Ground.on_boundary` for a point (3,), m, and a velocity (3,), m/s."""
        # the search begins at the first triangle, as well as at any
        k, _, foot = closest_feature(*self._mesh.tables, (float(point[0]), float(point[1]), float(point[2])), 0)
        # beside an edge or a corner it starts there, so that these are seen
        feature, place = feature_at(self._terrain, k, foot, ON_BOUNDARY, ON_BOUNDARY)
        state = self.in_flight(np.array(place), velocity)
        tool = as_record(state, SPACE_TOOL)
        tool.mode, tool.triangle, tool.feature = SLIDE, k, feature
        return state

    def carry(
        self, start: Array, stretches: Stretches, gains: Array, rows: int, limit: int
    ) -> tuple[Array, Array, int, Array]:
        """Answer `Ground.carry`: samples (rows, 12) and events (k, 8), in m, m/s, s and N s."""
        return carry_on_mesh(start, self._terrain, stretches, gains, rows, limit)
