"""Bodies that move: what a renderer answers there is, in the body's frame, what it answers to the body at rest."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from meta.honest import Spring

from hapticeval.discovery import resolve
from hapticeval.documents import convert
from hapticeval.errors import InputError, RefusalError, RendererError
from hapticeval.geometry.catalogue import make_model
from hapticeval.recordings.world import in_body, in_world, poses_of
from hapticeval.renderer import AtRest, Response
from hapticeval.runner.judging import judge
from hapticeval.runner.siblings import SiblingRuns
from hapticeval.scene import Scene
from hapticeval.simulation.answers import make_renderer
from hapticeval.simulation.closed_loop import simulate_closed_loop
from hapticeval.simulation.playback import play
from hapticeval.stimulus.motions import Poses, Slide, Spin, Swing
from hapticeval.stimulus.stimulus import Experiment, Path
from hapticeval.strategies import hand_paths, motions
from hapticeval.suite.case import Case

DT = 1e-3
CIRCLE = make_model("circle")
RADIUS = CIRCLE.size / 2.0
CHECKS = (
    "contact-kept", "continuous-contact", "contact-normal-force", "force-magnitude", "reset-clears",
    "drop-out",
)  # fmt: skip
"""Their questions do not hang on the sign of a number that may be zero, as whether a hand along a face leaves it."""


def moving_spring(scene):
    return AtRest(Spring(scene))


moving_spring.supports = {"moving"}


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("constraint", "star"),
        ("ideal", "star"),
        ("constraint+pp-v", "cube"),
    ],
)
@settings(max_examples=3)
@given(data=st.data())
def test_verdicts_and_numbers_are_those_of_the_body_at_rest(name, kind, data):
    factory, model = resolve(name), make_model(kind)
    path = data.draw(hand_paths(model, most_parts=1))
    motion = data.draw(motions(model))

    def judged(scene):
        return judge(factory, name, "drawn", Case(
            name="drawn", title="drawn", model={"kind": kind}, checks=CHECKS, trajectory=path, scene=scene,
        ))  # fmt: skip

    rest, moving = judged({"damping": 2.0}), judged({"damping": 2.0, "motion": motion})
    assert (rest.error, rest.refusal is None) == (moving.error, moving.refusal is None)
    # Whether a hand on the surface itself is in contact, rounding says, and where its force points then.
    tied = rest.recording is not None and np.abs(model.boundary.signed_distance(rest.recording.hip)) < 1e-12
    for still, moved in zip(rest.verdicts, moving.verdicts, strict=True):
        assert moved.outcome is still.outcome, (still.check, still.finding.message, moved.finding.message)
        if still.finding.metric is not None and not np.any(tied):
            size = max(abs(still.finding.metric.value), model.size)
            # A share is a median: where the hand hardly moves rounding says whether a tick counts, and its neighbour is
            # in the middle then.
            # The angle of a force that is some um deep is rounding too.
            allowed = 1e-9 * size if still.finding.metric.unit in ("m", "N") else 1e-7
            assert moved.finding.metric.value == pytest.approx(still.finding.metric.value, abs=allowed)
    if rest.recording is not None:
        for channel in ("hip", "ihip", "force", "velocity"):
            if channel in rest.recording.channels:
                here, there = (run.recording.channels[channel][~tied] for run in (rest, moving))
                assert here == pytest.approx(there, abs=1e-8)


class Logged(AtRest):
    """Keeps what it was asked, in the world."""

    def __init__(self, renderer):
        super().__init__(renderer)
        self.asked = []

    def step(self, hip, velocity, dt):
        answer = super().step(hip, velocity, dt)
        self.asked.append((self.pose, hip, velocity, *answer))
        return answer


def test_a_renderer_is_asked_in_the_world_at_the_pose_of_the_tick():
    motion = Swing(amplitude=(0.02, 0.0), hertz=2.0, across=(0.0, 0.01))
    scene, made = Scene(model=CIRCLE, motion=motion), []

    def factory(scene):
        made.append(Logged(Spring(scene)))
        return made[-1]

    path = Path(np.array([0.0, 0.3]), np.array([[RADIUS + 0.01, 0.0], [RADIUS - 0.01, 0.005]]))
    recording = play(make_renderer(factory, scene), path, DT, scene=scene)
    world = in_world(recording)
    poses, hips, velocities, ihips, forces = zip(*made[0].asked, strict=True)
    assert np.array([pose.translation for pose in poses]) == pytest.approx(recording.channels["body_translation"])
    for name, logged in (("hip", hips), ("ihip", ihips), ("force", forces), ("velocity", velocities)):
        assert world.channels[name] == pytest.approx(np.array(logged), abs=1e-9)
        assert in_body(world).channels[name] == pytest.approx(recording.channels[name], abs=1e-9)
    # the world's velocity is the difference of its places
    assert np.diff(world.hip, axis=0) / DT == pytest.approx(world.velocity[1:], abs=1e-9)
    assert poses_of(recording.channels).rotation[7] == pytest.approx(np.eye(2))
    still = play(make_renderer(factory, replace(scene, motion=None)), path, DT)
    assert poses_of(still.channels) is None
    assert in_world(still) is still


def test_a_hand_that_is_led_in_first_meets_the_body_where_it_then_is():
    motion = Slide(velocity=(0.2, 0.0))
    scene, made = Scene(model=CIRCLE, motion=motion), []

    def factory(scene):
        made.append(Logged(Spring(scene)))
        return made[-1]

    path = Path(np.array([0.0, 0.1]), np.array([[RADIUS - 0.01, 0.0], [RADIUS - 0.01, 0.005]]))
    recording = play(make_renderer(factory, scene), path, DT, scene=scene)
    assert recording.meta["lead_in_ticks"] > 0
    hips = np.array([hip for _, hip, *_ in made[0].asked])[recording.meta["lead_in_ticks"] :]
    assert in_world(recording).hip == pytest.approx(hips, abs=1e-9)


@settings(max_examples=10)
@given(st.integers(-20, 20), st.integers(-20, 20))
def test_a_loop_on_a_body_that_slides_evenly_does_as_on_one_at_rest(x, y):
    start = np.array([RADIUS + 0.001, 0.0])
    push = np.array([[-2.0, 0.5]])
    experiment = Experiment(0.3, start, np.array([-0.1, 0.05]), np.zeros(1), push)
    at_rest = Scene(model=CIRCLE, damping=2.0)
    moving = replace(at_rest, motion=Slide(velocity=(x / 20.0, y / 20.0)))
    for name in ("minimum-distance", "constraint+pp-v"):
        still, moved = (
            simulate_closed_loop(make_renderer(resolve(name), scene), experiment, scene, DT)
            for scene in (at_rest, moving)
        )
        assert still.force.any()
        for channel in ("hip", "ihip", "force", "velocity"):
            assert moved.channels[channel] == pytest.approx(still.channels[channel], abs=1e-8)
    assert in_world(moved).velocity[-1] == pytest.approx(still.velocity[-1] + np.array([x, y]) / 20.0, abs=1e-8)


@pytest.mark.parametrize("motion", [None, Spin(rate=1.0)], ids=["at rest", "moving"])
def test_a_wrapped_renderer_that_is_not_placed_is_the_renderer(motion):
    scene = Scene(model=CIRCLE, motion=motion)
    inner = resolve("constraint")(replace(scene, motion=None))
    outer = AtRest(inner)
    hip, velocity = np.array([RADIUS - 0.002, 0.001]), np.array([0.1, 0.2])
    inner.reset(hip)
    expected = inner.step(hip, velocity, DT)
    if motion is not None:
        outer.place(np.eye(2), np.zeros(2))
    outer.reset(hip)
    if motion is not None:
        outer.place(np.eye(2), np.zeros(2))
    answer = outer.step(hip, velocity, DT)
    assert np.array(answer) == pytest.approx(np.array(expected), abs=1e-15)
    assert outer.law is inner.law
    assert outer.declares == inner.declares
    assert outer.supports == {"moving"}
    assert not hasattr(outer, "observe_force")


class Feeling(Spring):
    def observe_force(self, push):
        self.push = push


def test_a_measured_force_is_given_in_the_axes_of_the_body():
    outer = AtRest(Feeling(Scene(model=CIRCLE)))
    outer.observe_force(np.array([1.0, 0.0]))
    assert outer.renderer.push == pytest.approx([1.0, 0.0])
    outer.place(np.array([[0.0, -1.0], [1.0, 0.0]]), np.zeros(2))
    outer.observe_force(np.array([1.0, 0.0]))
    assert outer.renderer.push == pytest.approx([0.0, -1.0])


# What is refused, and who is blamed

MOVING = Scene(model=CIRCLE, motion=Spin(rate=1.0))
ALONG = Path(np.array([0.0, 0.1]), np.array([[RADIUS + 0.01, 0.0], [RADIUS - 0.005, 0.0]]))


def test_a_renderer_that_knows_of_no_motion_is_refused(refused):
    with refused(RefusalError):
        make_renderer(Spring, MOVING)


class Unplaced(Spring):
    supports = frozenset({"moving"})


class Misplaced(AtRest):
    """Raises in its hundredth place."""

    count = 0

    def place(self, rotation, translation):
        self.count += 1
        if self.count == 51:
            raise ValueError("no such place")
        super().place(rotation, translation)


class Shapeless(AtRest):
    def step(self, hip, velocity, dt):
        return Response(np.zeros(3), np.zeros(2))


class Wordless(AtRest):
    def step(self, hip, velocity, dt):
        return "nothing"


def test_a_renderer_that_cannot_be_placed_is_no_renderer_of_moving_bodies(refused):
    with refused(RendererError):
        make_renderer(Unplaced, MOVING)


@pytest.mark.parametrize("kind", [Misplaced, Shapeless, Wordless])
def test_a_renderer_that_breaks_is_blamed_with_tick_and_hip(kind, refused):
    renderer = make_renderer(lambda scene: kind(Spring(scene)), MOVING)
    with refused(RendererError):
        play(renderer, ALONG, DT, scene=MOVING)


PRESSED = {"kind": "points", "points": [[0.0, 0.0], [0.01, 0.0]], "duration": 1.0}
PUSHED = {"duration": 0.1, "position": [0.2, 0.0]}


@pytest.mark.parametrize(
    ("motion", "entries"),
    [
        ({"kind": "spin", "rate": 1.0, "frame": "world"}, {"trajectory": PRESSED}),
        ({"kind": "spin", "rate": 1.0}, {"experiment": PUSHED}),
        ({"kind": "slide", "velocity": [0.1, 0.0], "frame": "world"}, {"experiment": PUSHED}),
    ],
)
def test_a_stimulus_that_does_not_fit_the_motion_is_refused_before_a_run(motion, entries, refused):
    case = convert(
        {"name": "moving", "title": "moving", "model": {"kind": "circle"}, "checks": ["contact-kept"],
         "scene": {"motion": motion}, **entries},
        Case, "case",
    )  # fmt: skip
    with refused(InputError):
        case.check_stimulus()


def test_of_a_body_that_jumps_each_stretch_is_judged_by_itself():
    still = (1.0, 0.0, 0.0, 1.0)
    motion = {"kind": "points", "poses": [(0.0, *still, 0.0, 0.0), (0.2, *still, 0.4, 0.1)], "jump_at": [0.2]}
    path = {"kind": "points", "duration": 0.4, "points": [[RADIUS + 0.01, 0.0], [RADIUS - 0.01, 0.0]]}
    case = convert(
        {"name": "jump", "title": "jump", "model": {"kind": "circle"}, "checks": ["contact-kept", "reset-clears"],
         "scene": {"motion": motion}, "trajectory": path},
        Case, "case",
    )  # fmt: skip
    siblings = SiblingRuns(moving_spring, case.build_scene(), case, "spring")
    stretches = siblings.judged_parts(siblings.runs())
    assert len(stretches) == 2
    for stretch in stretches:
        fine = stretch.refine(4)
        assert len(fine) == 4 * (len(stretch.base) - 1) + 1
        assert np.array_equal(fine.hip[::4], stretch.base.hip)
    judged = judge(moving_spring, "spring", "moving", case)
    assert judged.recording is not None
    assert [verdict.outcome.value for verdict in judged.verdicts] == ["pass", "pass"]
    spoiled = []

    class Startled(AtRest):
        """Answers nothing in the three ticks after a jump: so it may; with `late` longer."""

        def step(self, hip, velocity, dt):
            answer = super().step(hip, velocity, dt)
            jumped = self.pose.translation[0] > 0.0
            self.ticks = self.ticks + 1 if jumped else 0
            return Response(hip, 0.0 * hip) if 0 < self.ticks <= spoiled[0] else answer

        ticks = 0

    def startled(scene):
        return Startled(Spring(scene))

    for ticks, outcome in ((3, "pass"), (12, "fail")):
        spoiled[:] = [ticks]
        verdict = judge(startled, "startled", "moving", case).verdicts[0]
        assert verdict.outcome.value == outcome, verdict.finding.message


def test_poses_of_a_table_that_begins_elsewhere_are_known_at_the_reset():
    motion = Poses(poses=((0.0, 0.0, -1.0, 1.0, 0.0, 0.3, 0.1), (1.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0)))
    scene = Scene(model=CIRCLE, motion=motion)
    at_reset = []

    class Told(AtRest):
        def reset(self, hip):
            at_reset.append((self.pose, hip))
            super().reset(hip)

    play(make_renderer(lambda scene: Told(Spring(scene)), scene), ALONG, DT, scene=scene)
    pose, hip = at_reset[0]
    assert pose.to_body(hip) == pytest.approx(ALONG.points[0], abs=1e-12)
