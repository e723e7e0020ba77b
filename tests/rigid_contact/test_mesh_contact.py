"""The ideal contact on triangle meshes: closed forms, laws, and that it makes no difference how a face is cut."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import Delaunay
from scipy.spatial.transform import Rotation

from hapticeval.errors import InputError, RefusalError
from hapticeval.geometry import solids
from hapticeval.geometry.catalogue import make_model
from hapticeval.geometry.mesh import Mesh
from hapticeval.geometry.model import Model
from hapticeval.rigid_contact import ideal
from hapticeval.scene import Scene
from hapticeval.stimulus.stimulus import Experiment, Path
from hapticeval.suite.reading import load_suite

MASS = 0.1
TURN = Rotation.from_rotvec([0.3, -1.1, 0.7]).as_matrix()
CUBE = make_model("cube")
TOP = 0.05


def contact(model, **scene):
    return ideal(Scene(model=model, mass=MASS, **scene))


def mesh_model(vertices, triangles):
    return Model("mesh", {}, Mesh("mesh", vertices, triangles))


def inner_corner(turn):
    """A cube out of which an eighth is cut: three walls at right angles meet in the origin, free where x, y, z > 0."""
    grid = np.stack(np.meshgrid([-0.1, 0.0, 0.1], [-0.1, 0.0, 0.1], [-0.1, 0.0, 0.1], indexing="ij"), -1)
    cells = [cell for cell in np.ndindex(2, 2, 2) if cell != (1, 1, 1)]
    quads = []
    for cell in cells:
        for axis in range(3):
            for side in (0, 1):
                beyond = np.array(cell)
                beyond[axis] += 2 * side - 1
                if tuple(beyond.tolist()) in cells:
                    continue
                u, v = (axis + 1) % 3, (axis + 2) % 3
                square = np.tile(np.array(cell), (4, 1))
                square[:, axis] += side
                square[[1, 2], u] += 1
                square[[2, 3], v] += 1
                quads.append(square if side else square[::-1])
    corners = np.array([np.ravel_multi_index(square.T, (3, 3, 3)) for square in quads])
    triangles = np.concatenate([corners[:, [0, 1, 2]], corners[:, [0, 2, 3]]])
    return mesh_model(grid.reshape(-1, 3) @ turn.T, triangles)


def kinds(recording):
    return [event["kind"] for event in recording.meta["events"]]


def unit(vector):
    return vector / np.linalg.norm(vector)


def energy(recording, force):
    return 0.5 * MASS * np.sum(recording.velocity**2, axis=1) - recording.hip @ force


def test_a_tool_flies_off_the_edge_of_a_cube_as_a_parabola():
    """It falls onto the face, slides without a push along it, and falls on beside the cube."""
    experiment = Experiment(0.4, [0.0, 0.001, TOP + 0.01], [0.2, 0.01, 0.0], [0.0], [[0.0, 0.0, -1.0]])
    recording = contact(CUBE).simulate(experiment, 1e-3)
    assert kinds(recording) == ["impact", "leave"]
    impact, leave = recording.meta["events"]
    assert impact["time"] == pytest.approx(math.sqrt(2.0 * 0.01 / 10.0), abs=1e-15)
    np.testing.assert_allclose(impact["impulse"], [0.0, 0.0, MASS * math.sqrt(2.0 * 10.0 * 0.01)], atol=1e-15)
    assert leave["time"] == pytest.approx(0.25, abs=1e-12)
    np.testing.assert_allclose(leave["position"], [TOP, 0.0035, TOP], atol=1e-12)
    flown = recording.time[recording.time > leave["time"]] - 0.25
    parabola = np.column_stack([TOP + 0.2 * flown, 0.0035 + 0.01 * flown, TOP - 5.0 * flown**2])
    np.testing.assert_allclose(recording.hip[recording.time > leave["time"]], parabola, atol=1e-12)
    assert np.all(recording.force[recording.time > leave["time"]] == 0.0)


@pytest.mark.parametrize("turn", [np.eye(3), TURN])
def test_rest_in_an_inner_corner_takes_three_multipliers_until_one_is_zero(turn):
    """Thrown into it the tool rests, each wall with its part of the force; let go by one wall, it follows an edge."""
    push = np.array([[-1.0, -0.7, -0.4], [-1.0, -0.7, -0.4], [-1.0, -0.7, 0.4], [-1.0, 0.3, 0.4]])
    experiment = Experiment(
        0.65, turn @ [0.02, 0.015, 0.03], turn @ [-0.5, -0.4, -0.6], [0.0, 0.4, 0.5, 0.6], push @ turn.T
    )
    recording = contact(inner_corner(turn)).simulate(experiment, 1e-3)
    hip, force, time = recording.hip @ turn, recording.force @ turn, recording.time
    assert kinds(recording) == ["impact", "corner", "corner", "rest"]
    resting = (time > recording.meta["events"][-1]["time"]) & (time < 0.399)
    assert resting.sum() > 200
    np.testing.assert_allclose(hip[resting], 0.0, atol=1e-15)
    np.testing.assert_allclose(force[resting], np.tile(-push[0], (resting.sum(), 1)), atol=1e-12)
    # at 0.45 s the third part of the force is zero: along the z axis, where it grows by 8 N/s
    along = (time > 0.45) & (time < 0.5)
    np.testing.assert_allclose(hip[along, 2], 8.0 / MASS * (time[along] - 0.45) ** 3 / 6.0, atol=1e-12)
    np.testing.assert_allclose(hip[along, :2], 0.0, atol=1e-14)
    # at 0.57 s so is the second: over the wall x = 0, that alone holds
    over = time > 0.5705
    np.testing.assert_allclose(hip[over, 0], 0.0, atol=1e-14)
    assert np.all(hip[over, 1] > 0.0)
    np.testing.assert_allclose(force[over], np.tile([1.0, 0.0, 0.0], (over.sum(), 1)), atol=1e-12)


def test_an_impact_in_a_corner_turns_back_every_part_of_the_velocity():
    """Between walls at right angles no order of the impulses makes a difference: v becomes -c_r v."""
    for turn in (np.eye(3), TURN):
        velocity = np.array([-0.3, -0.5, -0.2])
        # no push: straight into the corner
        experiment = Experiment(0.2, turn @ (-0.1 * velocity), turn @ velocity, [0.0], [[0.0, 0.0, 0.0]])
        recording = contact(inner_corner(turn), restitution=0.5).simulate(experiment, 1e-3)
        np.testing.assert_allclose(recording.velocity[-1] @ turn, -0.5 * velocity, atol=1e-9)


@pytest.mark.parametrize(
    ("free_angle", "velocity", "after"),
    [(150.0, [0.1, -1.0], 0.1), (60.0, [-0.4, -0.3], 0.0), (90.0, [-0.4, -0.3], 0.0)],
)
def test_in_a_groove_the_wall_that_is_run_against_most_takes_its_impulse_first(free_angle, velocity, after):
    """With c_r = 0, as docs/ground-truth.md has it: at 150 degrees the wall first would leave 0.51 m/s."""
    x, y = 0.1 * math.cos(math.radians(free_angle)), 0.1 * math.sin(math.radians(free_angle))
    section = [[0.0, 0.0], [x, y], [-0.2, y], [-0.2, -0.1], [0.1, -0.1], [0.1, 0.0]]
    groove = make_model("extruded", model={"kind": "polygon", "vertices": section}, length=0.1)
    flight = np.array([*velocity, 0.0])
    experiment = Experiment(0.2, -0.05 * flight, flight, [0.0], [[0.0, 0.0, 0.0]])
    recording = contact(groove, restitution=0.0).simulate(experiment, 1e-3)
    np.testing.assert_allclose(recording.velocity[-1], [after, 0.0, 0.0], atol=1e-9)


@pytest.mark.parametrize(("shift", "accuracy"), [(0.0, 1e-9), (0.05, 1e-2)])
def test_hops_up_a_steep_side_of_less_than_a_skin_keep_the_speed_that_the_other_side_shows(shift, accuracy):
    """Pushed all but square to one side of a groove: each pass takes cos(turn) of the speed, down to hops of 1 fm."""
    turn, push, away = math.radians(30.0), 1e-5, 4e-9
    section = np.array([[0.0, 0.0], [-0.1, 0.1 * math.tan(turn)], [-0.1, -0.05], [0.1, -0.05], [0.1, 0.0]])
    groove = make_model("extruded", model={"kind": "polygon", "vertices": (section + shift).tolist()}, length=0.1)
    experiment = Experiment(0.1, [shift + away, shift, 0.0], [0.0, 0.0, 0.0], [0.0], [[-push, -1.0, 0.0]])
    recording = contact(groove, restitution=0.0).simulate(experiment, 1e-3)
    assert set(kinds(recording)) == {"corner"}
    sizes = np.linalg.norm([event["impulse"] for event in recording.meta["events"]], axis=1)
    arrives = math.sqrt(2.0 * push / MASS * away)
    expected = MASS * arrives * math.sin(turn) * math.cos(turn) ** np.arange(len(sizes))
    # hops are m v^2 / (2 F) long
    hops = 0.5 * MASS * (expected / (MASS * math.sin(turn))) ** 2 / (math.sin(turn) - push * math.cos(turn))
    counted = hops > 1e-15
    assert counted.sum() > 15
    np.testing.assert_allclose(sizes[counted], expected[counted], rtol=accuracy)
    # they come to their end
    assert len(sizes) < 30


def test_energy_stays_over_ten_thousand_elastic_events():
    force = TURN @ [-1.0, -0.8, -0.6]
    experiment = Experiment(215.0, TURN @ [0.004, 0.003, 0.005], [0.0, 0.0, 0.0], [0.0], [force])
    recording = contact(inner_corner(TURN), restitution=1.0).simulate(experiment, 0.05)
    assert len(recording.meta["events"]) > 10_000
    np.testing.assert_allclose(energy(recording, force), energy(recording, force)[0], rtol=0.0, atol=1e-10)


def cut_cube(points):
    """A cube whose top is cut into triangles between its corners and points (n, 2) inside of it."""
    box, triangles = solids.box((0.1, 0.1, 0.1))
    keep = np.any(box[triangles][:, :, 2] < 0.0, axis=1)
    corners = [[-0.05, -0.05], [0.05, -0.05], [0.05, 0.05], [-0.05, 0.05]]
    flat = np.concatenate([corners, points])
    cut = Delaunay(flat).simplices
    a, b, c = flat[cut.T]
    clockwise = (b - a)[:, 0] * (c - a)[:, 1] < (b - a)[:, 1] * (c - a)[:, 0]
    cut[clockwise] = cut[clockwise][:, ::-1]
    top = np.column_stack([flat, np.full(len(flat), 0.05)])
    vertices = np.concatenate([box, top[4:]])
    number = [int(np.flatnonzero(np.all(vertices == corner, axis=1))[0]) for corner in top[:4]]
    number += list(range(len(box), len(vertices)))
    return vertices, np.concatenate([triangles[keep], np.array(number)[cut]])


def cutting_points():
    """A grid, a fan of slivers that ends in one point, and points that lie 1e-9 m apart."""
    fan = np.column_stack([np.full(40, 0.03), 0.001 * (np.arange(40) - 20.0)])
    grid = np.stack(np.meshgrid(np.linspace(-0.04, 0.02, 7), np.linspace(-0.04, 0.04, 7)), -1).reshape(-1, 2)
    close = np.array([[0.0001, 0.0002], [0.0001, 0.0002 + 1e-9], [0.0001 + 1e-9, 0.0002]])
    return np.concatenate([grid, fan, close, [[0.0499, 0.0]]])


@pytest.mark.parametrize("turn", [None, TURN])
def test_a_face_of_two_hundred_triangles_is_one_of_two(turn):
    vertices, triangles = cut_cube(cutting_points())
    assert np.sum(np.all(vertices[triangles][:, :, 2] == 0.05, axis=1)) > 150
    plain, plain_triangles = cut_cube(np.empty((0, 2)))
    rotation = np.eye(3) if turn is None else turn
    models = [mesh_model(plain @ rotation.T, plain_triangles), mesh_model(vertices @ rotation.T, triangles)]
    for start, velocity, force in (
        ([-0.04, 0.013, 0.06], [0.3, -0.02, 0.0], [0.05, 0.0, -1.0]),
        ([-0.04, 0.0, 0.05], [0.3, 0.0, 0.0], [0.0, 0.0, -1.0]),
        ([0.03, -0.03, 0.06], [0.0, 0.2, 0.0], [0.0, 0.1, -1.0]),
        ([0.0001, 0.0002, 0.06], [0.0, 0.0, 0.0], [-0.3, 0.2, -1.0]),
    ):
        experiment = Experiment(0.6, rotation @ start, rotation @ velocity, [0.0], [rotation @ force])
        two, many = (contact(model, restitution=0.2).simulate(experiment, 1e-3) for model in models)
        assert kinds(two) == kinds(many)
        if turn is None:
            np.testing.assert_array_equal(two.hip, many.hip)
            np.testing.assert_array_equal(two.force, many.force)
        else:
            # a turned mesh has its own rounding of the face's plane
            np.testing.assert_allclose(two.hip, many.hip, rtol=0.0, atol=1e-13)


def test_edges_cut_in_pieces_are_the_same_edges():
    """Every triangle in four, twice: on the L-block's concave edge, over its convex ones and into it."""
    block = make_model("l-block")
    vertices, triangles = block.boundary.vertices, block.boundary.triangles
    for _ in range(2):
        ends = np.sort(np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), axis=1)
        edges, middle = np.unique(ends, axis=0, return_inverse=True)
        first, second, third = len(vertices) + middle.reshape(3, -1)
        a, b, c = triangles.T
        cut = ((a, first, third), (first, b, second), (third, second, c), (first, second, third))
        triangles = np.concatenate([np.column_stack(part) for part in cut])
        vertices = np.concatenate([vertices, vertices[edges].mean(axis=1)])
    models = [block, mesh_model(vertices, triangles)]
    for start, velocity, force in (
        ([0.02, 0.03, -0.04], [-0.2, -0.1, 0.15], [-0.4, -1.0, 0.0]),
        ([0.03, 0.02, 0.0], [-0.2, 0.0, 0.1], [0.3, -1.0, 0.2]),
    ):
        experiment = Experiment(0.6, start, velocity, [0.0, 0.3], [force, [0.5, -0.2, 0.1]])
        plain, cut = (contact(model).simulate(experiment, 1e-3) for model in models)
        assert len(plain.meta["events"]) >= 2
        np.testing.assert_allclose(plain.hip, cut.hip, rtol=0.0, atol=1e-13)


def test_on_icospheres_a_tool_leaves_where_it_does_on_the_sphere_with_order_one_half():
    """From rest at an angle t0 off the top a sphere lets go at cos t = 2/3 cos t0.

    At every edge of a mesh the tool hops, as far as v^2 d / N for a turn d. As N goes to zero with what is left to the
    sphere's angle, the last hop begins where both are alike: at sqrt(d) from it, so that the error falls with the root
    of the edges' length.
    """
    errors = []
    for subdivisions in (3, 4, 5, 6):
        model = make_model("icosphere", subdivisions=subdivisions, size=0.2)
        off = []
        for azimuth in np.linspace(0.0, 2.0 * math.pi, 24, endpoint=False) + 0.1:
            aside = 0.02 * np.array([math.cos(azimuth), math.sin(azimuth)])
            start = model.boundary.closest_point(np.array([[*aside, 0.1]])).foot[0]
            recording = contact(model).simulate(Experiment(0.6, start, [0, 0, 0], [0.0], [[0, 0, -1.0]]), 1e-3)
            last = recording.meta["events"][-1]
            assert last["kind"] == "leave"
            place = np.array(last["position"]) / np.linalg.norm(last["position"])
            off.append(math.acos(place[2]) - math.acos(2.0 / 3.0 * start[2] / np.linalg.norm(start)))
        errors.append(np.sqrt(np.mean(np.square(off))))
    # edges halve with each subdivision
    order = -np.polyfit(np.arange(len(errors)), np.log2(errors), 1)[0]
    assert errors[-1] < 0.05
    assert 0.3 < order < 0.7


SOLIDS = {
    name: next(case for case in load_suite("solids").cases if case.name.startswith(name)).build_scene().model
    for name in ("cube", "wedge-30", "l-block", "inner-corner", "extruded-star", "nut", "icosphere", "pebble")
}
numbers = st.floats(-1.0, 1.0)
triples = st.tuples(numbers, numbers, numbers)


@settings(max_examples=60)
@given(st.sampled_from(sorted(SOLIDS)), triples, triples, triples, st.sampled_from([0.0, 0.5, 1.0]))
def test_pushed_anywhere_it_keeps_to_momentum_and_energy_and_does_not_enter(name, side, velocity, push, restitution):
    model, side = SOLIDS[name], np.add(side, [0.0, 0.0, 1e-3])
    middle, outwards = np.mean(np.reshape(model.boundary.bounds, (2, 3)), axis=0), side / np.linalg.norm(side)
    force = -outwards + 0.7 * np.array(push)
    experiment = Experiment(0.6, middle + model.size * outwards, 0.3 * np.array(velocity), [0.0], [force])
    recording = contact(model, restitution=restitution).simulate(experiment, 1e-3)
    assert model.boundary.signed_distance(recording.hip).min() > -1e-12
    impulses = (recording.force + recording.channels["operator_force"]) * recording.dt
    np.testing.assert_allclose(np.diff(MASS * recording.velocity, axis=0), impulses[:-1], atol=1e-13)
    energies = energy(recording, force)
    assert np.diff(energies).max() <= 1e-11
    if restitution == 1.0 and "rest" not in kinds(recording):
        assert np.ptp(energies) <= 1e-10


def drawn_path(model, corners):
    """A path from outside of a model's box through points (n, 3) in 1.4 times that box, given in [-1, 1]."""
    low, high = np.reshape(model.boundary.bounds, (2, 3))
    points = 0.5 * (low + high) + 0.7 * np.vstack([[0.1, 0.2, 1.0], corners]) * (high - low)
    return Path(0.3 * np.arange(len(points)), points)


@settings(max_examples=40)
@given(st.sampled_from(sorted(SOLIDS)), st.lists(triples, min_size=1, max_size=4), st.sampled_from([0.0, 0.5]))
def test_led_anywhere_it_does_not_enter(name, corners, restitution):
    model = SOLIDS[name]
    recording = contact(model, restitution=restitution).simulate(drawn_path(model, corners), 1e-3)
    assert model.boundary.signed_distance(recording.hip).min() > -1e-12


@pytest.mark.parametrize("name", sorted(SOLIDS))
def test_it_moves_with_its_scene(name):
    """Along points in general positions: an edge that is hit exactly, or a tie of two faces, rounding decides."""
    shift, model = np.array([0.1, -0.2, 0.3]), SOLIDS[name]
    moved = mesh_model(model.boundary.vertices @ TURN.T + shift, model.boundary.triangles)
    rng = np.random.default_rng(29)
    for _ in range(6):
        path = drawn_path(model, rng.uniform(-1.0, 1.0, (3, 3)))
        here = contact(model).simulate(path, 1e-3)
        there = contact(moved).simulate(Path(path.time, path.points @ TURN.T + shift), 1e-3)
        np.testing.assert_allclose((there.hip - shift) @ TURN, here.hip, rtol=0.0, atol=1e-9)


def test_what_it_cannot_do_is_refused_by_name(refused):
    with refused(RefusalError):
        contact(CUBE, bilateral=True)
    with refused(RefusalError):
        contact(CUBE).simulate(Experiment(0.1, [0, 0, 0], [0, 0, 0], [0.0], [[0, 0, 0]]), 1e-3)
    with refused(InputError):
        contact(CUBE).simulate(Path([0.0, 1.0], np.zeros((2, 2))), 1e-3)


@pytest.mark.parametrize("speed", [1e-4, 0.015, 0.5])
def test_past_the_end_of_a_concave_edge_nothing_is_left_to_push(speed):
    """Along the notch of an L and off over its end face, drawn aside: the seam of its faces ends with the edge."""
    experiment = Experiment(0.2, [-0.01, -0.01, 0.05 - 0.05 * speed], [0.0, 0.0, speed], [0.0], [[-20.2, -6.9, 0.0]])
    recording = contact(make_model("l-block")).simulate(experiment, 1e-3)
    leave = next(event for event in recording.meta["events"] if event["kind"] == "leave")
    np.testing.assert_allclose(leave["position"], [-0.01, -0.01, 0.05], atol=1e-9)
    assert recording.meta["events"][-1] == leave
    assert np.all(recording.force[recording.time > leave["time"]] == 0.0)
    assert recording.hip[-1, 0] < -0.1


@pytest.mark.parametrize("beside", [-6e-10, 0.0, 6e-10])
def test_beside_a_cut_of_a_concave_edge_both_faces_meet_the_tool_as_elsewhere_on_it(beside):
    """Over the notch of an L of many triangles, some of which reach its edge in a corner only."""
    block = make_model("l-block")
    for edge_height in (-0.041, -0.02, 0.029):
        target = np.array([-0.01, -0.01, edge_height + beside])
        velocity = np.array([-0.3, -0.1, -0.07])
        experiment = Experiment(0.2, target - 0.1 * velocity, velocity, [0.0], [[0.0, 0.0, 0.0]])
        plain, cut = (contact(model, restitution=0.3).simulate(experiment, 1e-3) for model in (block, block.cut()))
        assert kinds(plain) == kinds(cut) == ["impact"]
        np.testing.assert_allclose(plain.hip, cut.hip, rtol=0.0, atol=1e-12)


def test_no_tool_slips_through_between_the_triangles_of_a_face():
    """Turned and shifted, so that corners are off their faces by rounding; aimed at edges within faces, and corners."""
    cut = make_model("icosphere", subdivisions=1, size=0.1).cut().boundary
    model = mesh_model(cut.vertices @ TURN.T + np.array([0.3, -0.2, 0.1]), cut.triangles)
    mesh, tool, rng = model.boundary, contact(model), np.random.default_rng(3)
    for triangle in rng.choice(len(mesh.triangles), 100, replace=False):
        # the last corner of each lies within the face that was cut, and so do the edges to it
        _, outer, inner = mesh.vertices[mesh.triangles[triangle]]
        normal = mesh.normals[triangle]
        for share in (1.0, rng.uniform()):
            # at angles to the face down to some 1e-3 rad
            velocity = 0.1 * unit(unit(rng.normal(size=3)) - 10.0 ** rng.uniform(-1.0, 1.0) * normal)
            velocity -= normal * max(0.0, velocity @ normal + 1e-4)
            target = outer + share * (inner - outer)
            experiment = Experiment(0.1, target - 0.05 * velocity, velocity, [0.0], [[0.0, 0.0, 0.0]])
            if mesh.signed_distance(experiment.position[np.newaxis])[0] > 0.0:
                recording = tool.simulate(experiment, 1e-3)
                assert mesh.signed_distance(recording.hip).min() > -1e-12
                assert "impact" in kinds(recording)


def dimpled_icosphere():
    """An icosphere with a corner pushed in: around it, narrow faces meet in concave edges and end in convex ones."""
    icosphere = make_model("icosphere", subdivisions=1, size=0.1).boundary
    vertices = icosphere.vertices.copy()
    vertices[0] *= 0.6
    return mesh_model(vertices, icosphere.triangles)


@pytest.mark.parametrize("faces", ["whole", "cut"])
def test_within_a_nanometre_of_a_corner_a_tool_goes_as_it_does_within_a_micrometre(faces):
    """A corner is a cone, which is itself at any scale: no face of it reaches out beside its edges."""
    model, rng, impacts = dimpled_icosphere(), np.random.default_rng(7), 0
    mesh = model.boundary
    for corner in np.unique(mesh.triangles[np.any(mesh.triangles == 0, axis=1)]):
        centred = mesh_model(mesh.vertices - mesh.vertices[corner], mesh.triangles)
        tool = contact(centred if faces == "whole" else centred.cut())
        for _ in range(60):
            velocity, offset = 0.1 * unit(rng.normal(size=3)), rng.normal(size=3)
            offset = rng.uniform(0.0, 1.0) * unit(offset - (offset @ unit(velocity)) * unit(velocity))
            near, far = (
                first_impulse(tool, Experiment(0.02, reach * offset - 0.01 * velocity, velocity, [0.0], [[0, 0, 0]]))
                for reach in (1e-9, 1e-6)
            )
            np.testing.assert_allclose(near, far, rtol=0.0, atol=1e-9)
            impacts += bool(np.any(near))
    assert impacts > 50


def first_impulse(tool, experiment):
    """The impulse (3,), N s, of the first impact; zero without one, and for a way that begins in the solid."""
    try:
        events = tool.simulate(experiment, 1e-3).meta["events"]
    except RefusalError:
        return np.zeros(3)
    return np.array(events[0]["impulse"]) if events else np.zeros(3)


@pytest.mark.timeout(60)
@pytest.mark.parametrize("lift", [0.0, 1e-30, 1e-18])
def test_level_with_a_face_a_tool_flies_in_over_its_edge_as_if_there_were_none(lift):
    """It crosses the plane of the face at the side, beside it by less than rounding: nothing there is in its way."""
    experiment = Experiment(0.2, [0.06, 0.013, TOP], [-0.1, 0.02, 0.0], [0.0], [[0.0, 0.0, lift]])
    recording = contact(CUBE).simulate(experiment, 1e-3)
    straight = experiment.position + recording.time[:, np.newaxis] * experiment.velocity
    np.testing.assert_allclose(recording.hip, straight, rtol=0.0, atol=1e-12)
    assert recording.meta["events"] == []


@pytest.mark.parametrize(("depth", "expected"), [(0.0, set()), (1e-12, {"impact"})])
@pytest.mark.parametrize("faces", ["whole", "cut"])
def test_level_with_the_end_of_a_prism_no_cut_of_its_sides_is_in_the_way(faces, depth, expected):
    """Which side of the rim a tool comes to is rounding of the side's normal; that of one 1 pm below the rim is not."""
    model = make_model("cylinder", sides=7, size=0.1, length=0.4)
    tool, rng = contact(model if faces == "whole" else model.cut()), np.random.default_rng(5)
    top = model.boundary.vertices[:, 2].max()
    for angle in rng.uniform(0.0, 2.0 * math.pi, 30):
        towards = angle + rng.uniform(-0.5, 0.5)
        velocity = -0.1 * np.array([math.cos(towards), math.sin(towards), 0.0])
        start = np.array([0.08 * math.cos(angle), 0.08 * math.sin(angle), top - depth])
        recording = tool.simulate(Experiment(0.6, start, velocity, [0.0], [[0.0, 0.0, 0.0]]), 1e-3)
        assert set(kinds(recording)) & {"impact"} == expected
        if not expected:
            straight = start + recording.time[:, np.newaxis] * velocity
            np.testing.assert_allclose(recording.hip, straight, rtol=0.0, atol=1e-12)


SLOT = {
    "kind": "polygon",
    "vertices": [[0.02, 0.006], [0.002, 0.025], [-0.012, 0.019], [-0.009233, 0.006473], [-0.021517, 0.000797],
                 [-0.016564, -0.025], [0.021517, -0.007406]],
}  # fmt: skip
"""A section with a concave corner, the fourth, which a hand goes into and stays at within 20 um."""


@pytest.mark.parametrize("factor", [7.0, 1.0 / 7.0])
def test_a_scaled_scene_gives_the_scaled_motion_in_a_corner_too(factor):
    """Hops that are contact, and depths that are inside, are shares of the size: to rounding nothing differs."""
    points = np.array([
        [-0.0258, 0.0081, 0.0], [-0.0031, 0.0125, 0.0], [-0.0117, 0.0068, 0.04], [-0.01113, 0.00555, 0.04],
        [-0.009217, 0.006438, 0.04], [-0.009178, 0.006445, 0.04], [-0.009195, 0.00648, 0.04], [-0.0096, 0.0087, 0.04],
    ])  # fmt: skip
    model = make_model("extruded", model=SLOT, length=0.1)
    large = mesh_model(factor * model.boundary.vertices, model.boundary.triangles)
    times = 0.3 * np.arange(len(points))
    base, scaled = (
        contact(scene_model).simulate(Path(times, share * points), 1e-3)
        for scene_model, share in ((model, 1.0), (large, factor))
    )
    assert "corner" in kinds(base)
    np.testing.assert_allclose(scaled.hip, factor * base.hip, rtol=0.0, atol=1e-13 * factor)


@pytest.mark.timeout(60)
def test_hops_without_number_are_refused_with_time_and_place(refused):
    """Hops of 0.2 us, which no restitution ends: half a million in one sample."""
    experiment = Experiment(0.1, [0.01, 0.02, TOP], [0.0, 0.0, 0.01], [0.0], [[0.0, 0.0, -1e4]])
    with refused(RefusalError):
        contact(CUBE, restitution=1.0).simulate(experiment, 0.1)


NOTCH = {
    "kind": "polygon",
    "vertices": [[0.0, 0.0], [0.03, -0.05], [0.07, -0.02], [0.05, 0.05], [-0.05, 0.05], [-0.05, -0.05]],
}


@pytest.mark.timeout(60)
@pytest.mark.parametrize("offset", [-1e-9, 0.0, 1e-9])
@pytest.mark.parametrize("speed", [4e-5, 0.05])
def test_on_an_end_face_it_slides_square_to_the_side_of_a_notch_past_the_tip_of_it(speed, offset):
    """Over the very end of that side, where the face goes on: it is put back onto the tip no more, again and again."""
    side = np.array([0.03, -0.05]) / math.hypot(0.03, 0.05)
    ahead = np.array([side[1], -side[0]])  # square to the first side of the notch, out of the solid
    start = np.append(-speed * 0.1 * ahead + offset * side, TOP)
    model = make_model("extruded", model=NOTCH, length=2.0 * TOP)
    experiment = Experiment(0.2, start, [*(speed * ahead), 0.0], [0.0], [[0.0, 0.0, -1.0]])
    recording = contact(model).simulate(experiment, 1e-3)
    if offset > 0.0:
        assert kinds(recording)[-1] != "rest"  # it falls into the notch
        return
    straight = experiment.position + recording.time[:, np.newaxis] * experiment.velocity
    np.testing.assert_allclose(recording.hip, straight, rtol=0.0, atol=1e-12)
    assert recording.meta["events"] == []
