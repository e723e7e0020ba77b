"""Playback: what is asked of a renderer, and how a broken one is told."""

from __future__ import annotations

import numpy as np
import pytest

from hapticeval.compiled import compiled
from hapticeval.discovery import resolve
from hapticeval.errors import DomainError, RefusalError, RendererError, describe_error
from hapticeval.geometry.catalogue import cassinian, line
from hapticeval.laws import law_data
from hapticeval.recordings.recording import Recording
from hapticeval.renderer import CompiledStep, Declaration, Response, wrapped
from hapticeval.scene import Scene
from hapticeval.simulation.answers import make_renderer
from hapticeval.simulation.checked_calls import step_checked
from hapticeval.simulation.closed_loop import simulate_closed_loop
from hapticeval.simulation.playback import Closeup, hold_law_to_step, play, play_in_turns, play_while_defined, run_path
from hapticeval.stimulus.stimulus import Experiment, Path

PATH = Path(np.array([0.0, 1.0]), np.array([[0.0, 0.0], [0.1, 0.0]]))


class Echo:
    resolution = 0.002

    def __init__(self):
        self.resets = []
        self.velocities = []

    def reset(self, hip):
        self.resets.append(hip)

    def step(self, hip, velocity, dt):
        self.velocities.append(velocity)
        return Response(hip, np.zeros(2))


def test_every_sample_is_asked_once_with_the_velocity_known_by_then():
    renderer = Echo()
    recording = play(renderer, PATH, 0.01)
    assert len(recording) == 101
    assert len(renderer.resets) == 1
    np.testing.assert_array_equal(renderer.velocities[0], [0.0, 0.0])
    np.testing.assert_allclose(renderer.velocities[1:], np.tile([0.1, 0.0], (100, 1)), atol=1e-12)
    assert recording.resolution == 0.002
    assert recording.standoff == 0.0
    assert not recording.contact.any()


def test_a_renderer_cannot_change_the_recorded_hip():
    class Vandal(Echo):
        def step(self, hip, velocity, dt):
            answer = Response(hip.copy(), np.zeros(2))
            hip[:] = 99.0
            return answer

    np.testing.assert_array_equal(play(Vandal(), PATH, 0.01).hip, PATH.sampled(0.01)[1])


@pytest.mark.parametrize(
    "answer",
    [
        lambda hip: Response(np.zeros(3), np.zeros(2)),
        lambda hip: Response(hip, np.array([np.nan, 0.0])),
        lambda hip: Response(np.array([np.inf, 0.0]), np.zeros(2)),
        lambda hip: 1 / 0,
        lambda hip: Response(hip, "force"),
    ],
)
def test_a_broken_step_is_named_with_tick_and_hip(refused, answer):
    class Breaks(Echo):
        def step(self, hip, velocity, dt):
            self.velocities.append(velocity)
            return answer(hip) if len(self.velocities) > 50 else Response(hip, np.zeros(2))

    with refused(RendererError) as caught:
        play(Breaks(), PATH, 0.01)
    assert caught.value.tick == 50
    assert caught.value.hip == pytest.approx((0.05, 0.0))
    assert caught.value.exit_code == 3


class Unreadable(Exception):
    """As of a C++ library, whose text is bytes in another encoding."""

    def __str__(self):
        return b"\xb5m".decode()


def raises(*_):
    raise Unreadable


UNREADABLE = r"raised Unreadable: \(its text cannot be read: UnicodeDecodeError\)"


@pytest.mark.parametrize("method", ["reset", "step", "observe_force"])
def test_an_exception_whose_text_cannot_be_read_is_one_as_any(refused, method):
    renderer = Echo()
    setattr(renderer, method, raises)
    scene = Scene(model=line())
    pushes = np.zeros((2, 2)) if method == "observe_force" else None
    with refused(RendererError) as caught:
        run_path(renderer, np.zeros((2, 2)), np.zeros((2, 2)), 1e-3, scene=scene, pushes=pushes)
    assert caught.value.tick == 0
    assert isinstance(caught.value.__cause__, Unreadable)


def test_so_is_one_of_a_factory_and_of_a_stimulus_answered_whole(refused):
    with refused(RendererError):
        make_renderer(raises, Scene(model=line()))

    class Whole:
        simulate = raises

    with refused(RendererError):
        play(Whole(), PATH, 0.01)


def test_a_text_that_no_file_can_take_is_escaped():
    assert describe_error(ValueError("\udcb5m")) == r"ValueError: \udcb5m"


def test_the_text_of_an_exception_stands_in_one_line():
    assert describe_error(ValueError("no such valve\n  at the pump\n")) == "ValueError: no such valve; at the pump"


def test_a_renderer_with_a_step_is_asked_step_by_step_whatever_else_it_has():
    class Helped(Echo):
        def answer(self, hip):
            return Response(hip, np.zeros(2))

        def step(self, hip, velocity, dt):
            return self.answer(hip)

    scene = Scene(model=line())
    renderer = make_renderer(lambda scene: Helped(), scene)
    assert len(play(renderer, PATH, 0.01)) == 101
    push = Experiment(0.01, np.zeros(2), np.zeros(2), np.zeros(1), np.array([[0.0, -1.0]]))
    assert len(simulate_closed_loop(renderer, push, scene, 1e-3)) == 11


class Behind(Echo):
    """Answers the HIP of two ticks ago."""

    def reset(self, hip):
        self.last = [hip, hip]

    def step(self, hip, velocity, dt):
        self.velocities.append(velocity)
        self.last = [*self.last[-2:], hip]
        return Response(self.last[0], np.zeros(2))


def test_a_closer_look_takes_finer_steps_from_where_the_proxy_has_caught_up():
    renderer = Behind()
    look = Closeup.of(renderer, play(renderer, PATH, 0.01), Scene(model=line()))
    fine = look.refined(50, 52, 4, lag=3)
    finest = fine.refined(3, 5, 64, lag=3)
    for found, first, last, count in ((fine, 0.05, 0.052, 8), (finest, 0.05075, 0.05125, 128)):
        recording = found.recording
        assert len(recording) == 1 + count + 3
        np.testing.assert_allclose(recording.hip[: count + 1, 0], np.linspace(first, last, count + 1), atol=1e-15)
        np.testing.assert_array_equal(recording.hip[count:], np.tile(recording.hip[count], (4, 1)))
        np.testing.assert_array_equal(recording.ihip[:3, 0], recording.hip[[0, 0, 0], 0])  # it rested there
        np.testing.assert_array_equal(recording.ihip[2:], recording.hip[:-2])
        np.testing.assert_allclose(recording.velocity[1 : count + 1, 0], 0.1)
        np.testing.assert_allclose(np.diff(recording.time), 0.02 / 8 if found is fine else 0.01 / 256)
    assert fine.recording.time[8] == pytest.approx(0.52)


class Stepped:
    """A renderer of which only its steps are shown."""

    def __init__(self, base):
        self.reset, self.step = base.reset, base.step


@pytest.mark.parametrize("name", ["constraint", "minimum-distance+pp-d", "set-stabilisation", "conformal+square-root"])
def test_a_closer_look_in_one_call_is_that_of_single_steps_to_the_last_bit(name):
    scene = Scene(model=cassinian(), damping=2.0)
    path = Path(np.array([0.0, 0.3]), np.array([[0.105, 0.002], [0.08, 0.02]]))
    found = []
    for renderer in (resolve(name)(scene), Stepped(resolve(name)(scene))):
        assert wrapped(renderer).law is not None or found
        look = Closeup.of(renderer, play(renderer, path, 1e-3, scene=scene), scene).refined(200, 230, 8, lag=2)
        found += [look.recording, look.refined(20, 22, 4, lag=2).recording]
    for one, other in ((found[0], found[2]), (found[1], found[3])):
        assert np.any(one.force != 0.0)
        for channel in ("hip", "ihip", "force", "velocity"):
            np.testing.assert_array_equal(one.channel(channel), other.channel(channel))


class Counts(Echo):
    """Pushes with as many newtons as it has had ticks; raises at a HIP beyond `bound` (m)."""

    bound = 2.0

    def reset(self, hip):
        self.ticks = 0

    def step(self, hip, velocity, dt):
        if hip[0] > self.bound:
            raise IndexError("no such face")
        self.ticks += 1
        return Response(hip, np.array([0.0, float(self.ticks)]))


def test_a_step_that_breaks_in_a_closer_look_is_blamed_at_its_tick(refused):
    """Fine ticks are counted on from that of the path: the 9th fine step of four a tick is beyond 52 mm."""
    renderer = Counts()
    look = Closeup.of(renderer, play(renderer, PATH, 0.01), Scene(model=line()))
    renderer.bound = 0.0521
    with refused(RendererError) as caught:
        look.refined(50, 54, 4, lag=2)
    assert "step()" in caught.value.what
    assert caught.value.tick == 50 + 8
    assert caught.value.hip[0] == pytest.approx(0.05225)


def test_in_turns_a_step_that_breaks_is_blamed_at_its_tick(refused):
    first, second = Counts(), Counts()
    first.bound = 0.0205
    scene = Scene(model=line())
    with refused(RendererError) as caught:
        play_in_turns((first, PATH, scene), (second, PATH, scene), 0.01)
    assert (caught.value.tick, second.ticks) == (21, 16)


def test_a_tick_after_the_way_in_is_found_in_a_log_of_the_renderer():
    """The hand begins inside: the renderer answers the way in, too, which is no part of the recording."""
    scene = Scene(model=line())

    class Logs(Echo):
        def reset(self, hip):
            self.log = []

        def step(self, hip, velocity, dt):
            self.log.append(hip)
            if self.breaks_at is not None and hip[0] >= self.breaks_at:
                raise IndexError("no such face")
            return super().step(hip, velocity, dt)

    path = Path(np.array([0.0, 1.0]), np.array([[0.0, -0.01], [1.0, -0.01]]))
    renderer = Logs()
    renderer.breaks_at = None
    recording = play(renderer, path, 0.01, scene=scene)
    led_in = recording.meta["lead_in_ticks"]
    assert led_in == len(renderer.log) - len(recording) > 0
    np.testing.assert_array_equal(renderer.log[led_in:], recording.hip)
    assert "lead_in_ticks" not in play(renderer, path, 0.01).meta, "without a scene nothing is led in"
    renderer.breaks_at = 0.505
    with pytest.raises(RendererError) as caught:
        play(renderer, path, 0.01, scene=scene)
    assert caught.value.tick == 51
    assert f"; call {led_in + 52} of step() since the reset, {led_in} of which lead" in caught.value.what
    np.testing.assert_array_equal(renderer.log[led_in + 51], caught.value.hip)


class WithLaw:
    """Minimum distance by its compiled step; `step` pushes a little harder beyond x = `from_x` (m)."""

    def __init__(self, scene, from_x=np.inf, noise=False):
        self.base, self.from_x, self.noise = resolve("minimum-distance")(scene), from_x, noise
        self.law, self.reset, self.rng = self.base.law, self.base.reset, np.random.default_rng(1)

    def step(self, hip, velocity, dt):
        ihip, force = self.base.step(hip, velocity, dt)
        off = 1e-12 if hip[0] > self.from_x else 0.0
        return ihip, force * (1.0 + off * (self.rng.random() if self.noise else 1.0))


PRESSED = Path(np.array([0.0, 1.0]), np.array([[0.0, -0.01], [0.1, -0.01]]))


def hold(renderer):
    recording = play(renderer, PRESSED, 0.01)
    hold_law_to_step(wrapped(renderer), recording, contact=recording.contact)


def test_a_law_that_is_off_its_step_by_a_digit_is_named_with_tick_and_hip(refused):
    scene = Scene(model=line())
    hold(WithLaw(scene))
    with refused(RendererError) as caught:
        hold(WithLaw(scene, from_x=0.0305))
    assert caught.value.tick == 31
    assert caught.value.hip == pytest.approx((0.031, -0.01))


def test_answers_that_are_never_the_same_twice_are_no_matter_of_the_law():
    hold(WithLaw(Scene(model=line()), from_x=0.0, noise=True))


@compiled
def refuse_beyond(data, hip, velocity, push, dt, ihip, force):
    """A law that refuses a hand beyond 30 mm, and answers no number at 20 mm."""
    ihip[:] = hip
    force[:] = np.nan if abs(hip[0] - 0.02) < 1e-9 and data.params[0] == 1.0 else 0.0
    return 1 if hip[0] > 0.0305 else 0


class OnlyLaw(Echo):
    def __init__(self, breaks):
        super().__init__()
        self.law = CompiledStep(refuse_beyond, law_data([breaks]), {1: "too far"})


def test_a_law_that_refuses_where_its_step_answers_or_answers_no_number_is_blamed(refused):
    for breaks, tick in ((0.0, 31), (1.0, 20)):
        with refused(RendererError) as caught:
            play(OnlyLaw(breaks), PATH, 0.01)
        assert caught.value.tick == tick


class Refuses:
    """Refuses the scene at its n-th answer."""

    def __init__(self, number):
        self.number = number

    def reset(self, hip):
        self.answers = 0

    def step(self, hip, velocity, dt):
        self.answers += 1
        if self.answers == self.number:
            raise RefusalError("this scene", why="it is not for it")
        return hip, 0.0 * hip


def test_a_refusal_stands_before_the_first_answer(refused):
    path = Path(np.array([0.0, 0.01]), np.array([[0.2, 0.0], [0.3, 0.0]]))
    with pytest.raises(RefusalError):
        play(Refuses(1), path, 1e-3)
    with refused(RendererError):
        play(Refuses(5), path, 1e-3)


class RefusesWhereItRests(Refuses):
    """Refuses a hand that has moved and stands still: what a close-up asks first, where it begins."""

    def step(self, hip, velocity, dt):
        if self.moved and not np.any(velocity):
            raise RefusalError("a hand at rest", why="it is not for it")
        self.moved = bool(np.any(velocity))
        return hip, 0.0 * hip

    def reset(self, hip):
        self.moved = False


def test_a_refusal_in_a_close_up_or_at_a_later_turn_is_the_renderers_fault(refused):
    scene = Scene(model=line())
    renderer = RefusesWhereItRests(0)
    look = Closeup.of(renderer, play(renderer, PATH, 0.01), scene)
    with refused(RendererError):
        look.refined(50, 52, 4, lag=3)
    # The first answer of the second turn is its ninth.
    party = (Refuses(9), PATH, scene)
    with refused(RendererError):
        play_in_turns(party, (Refuses(0), PATH, scene), 0.01)
    with pytest.raises(RefusalError):
        play_in_turns((Refuses(0), PATH, scene), (Refuses(1), PATH, scene), 0.01)


class OwnBuffers:
    """Writes each answer into the same two arrays."""

    def reset(self, hip):
        self.ihip, self.force = np.zeros(2), np.zeros(2)

    def step(self, hip, velocity, dt):
        self.ihip[:], self.force[:] = hip, 2.0 * hip
        return self.ihip, self.force


class Bounded(Echo):
    """Defined up to x = `edge`, m."""

    def __init__(self, edge):
        super().__init__()
        self.edge = edge

    def step(self, hip, velocity, dt):
        if hip[0] > self.edge:
            raise DomainError("off the map", why="it ends there")
        return super().step(hip, velocity, dt)


def test_a_run_ends_where_the_renderer_is_no_longer_defined(refused):
    found = play_while_defined(Bounded(0.0505), PATH, 0.01)
    assert found.meta["ended"] == {
        "tick": 51,
        "time": pytest.approx(0.51),
        "what": "off the map",
        "why": "it ends there",
    }
    whole = play(Bounded(1.0), PATH, 0.01)
    for name, values in whole.channels.items():
        assert np.array_equal(found.channels[name], values[:51])
    assert "ended" not in play_while_defined(Bounded(1.0), PATH, 0.01).meta
    for edge in (-1.0, 0.0005):  # at the start, and after it
        with refused(DomainError):
            play_while_defined(Bounded(edge), PATH, 0.01)


def test_an_answer_stays_what_it_was():
    renderer = OwnBuffers()
    renderer.reset(np.zeros(2))
    first, _ = step_checked(renderer, 0, np.ones(2), np.zeros(2), 1e-3)
    step_checked(renderer, 1, np.full(2, 3.0), np.zeros(2), 1e-3)
    np.testing.assert_array_equal(first, np.ones(2))


def test_a_spring_that_is_none_is_refused(refused):
    renderer = OwnBuffers()
    renderer.declares = Declaration(spring="sprung")
    with refused(RendererError):
        wrapped(renderer)


def test_a_step_without_an_answer_is_blamed_on_the_renderer(refused):
    class Silent(Echo):
        def step(self, hip, velocity, dt):
            return None

    with refused(RendererError):
        play(Silent(), Path([0.0, 1.0], [[0.0, 0.0], [1.0, 0.0]]), 0.5)


def test_a_whole_answer_has_the_clock_and_the_space_that_were_asked_for(refused):
    class Whole:
        def __init__(self, time, size):
            self.time, self.size = np.asarray(time), size

        def simulate(self, stimulus, dt):
            still = np.zeros((self.time.size, self.size))
            return Recording(self.time, {"hip": still, "ihip": still, "force": still})

    path = Path([0.0, 1.0], [[0.0, 0.0], [1.0, 0.0]])
    assert len(play(Whole([0.0, 0.5, 1.0], 2), path, 0.5)) == 3
    for time, size in (([0.0, 0.5], 2), ([0.0, 0.4, 0.8], 2), ([0.0, 0.5, 1.0], 3)):
        with refused(RendererError):
            play(Whole(time, size), path, 0.5)
