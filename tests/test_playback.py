"""Playback: what is asked of a renderer, and how a broken one is told."""

from __future__ import annotations

import numpy as np
import pytest

from hapticeval.errors import RendererError
from hapticeval.playback import play
from hapticeval.renderer import Response
from hapticeval.stimulus import Path

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
    ("answer", "message"),
    [
        (lambda hip: Response(np.zeros(3), np.zeros(2)), "shape"),
        (lambda hip: Response(hip, np.array([np.nan, 0.0])), "not finite"),
        (lambda hip: Response(np.array([np.inf, 0.0]), np.zeros(2)), "not finite"),
        (lambda hip: 1 / 0, "ZeroDivisionError"),
        (lambda hip: Response(hip, "force"), "could not convert"),
    ],
)
def test_a_broken_step_is_named_with_tick_and_hip(answer, message):
    class Breaks(Echo):
        def step(self, hip, velocity, dt):
            self.velocities.append(velocity)
            return answer(hip) if len(self.velocities) > 50 else Response(hip, np.zeros(2))

    with pytest.raises(RendererError, match=message) as caught:
        play(Breaks(), PATH, 0.01)
    assert caught.value.tick == 50
    assert caught.value.hip == pytest.approx((0.05, 0.0))
    assert caught.value.exit_code == 3


class Batched(Echo):
    def run(self, hips, dt):
        return hips.copy(), np.zeros_like(hips)


def test_a_batch_is_preferred():
    renderer = Batched()
    assert len(play(renderer, PATH, 0.01)) == 101
    assert renderer.velocities == []


def test_a_broken_batch_is_searched_step_by_step():
    class Breaks(Batched):
        def run(self, hips, dt):
            raise ValueError("somewhere")

        def step(self, hip, velocity, dt):
            if hip[0] > 0.0305:
                raise ValueError("here")
            return Response(hip, np.zeros(2))

    with pytest.raises(RendererError, match="here") as caught:
        play(Breaks(), PATH, 0.01)
    assert caught.value.tick == 31


def test_a_batch_that_breaks_where_its_steps_do_not_says_so():
    class Breaks(Batched):
        def run(self, hips, dt):
            raise ValueError("batch only")

    with pytest.raises(RendererError, match="batch only") as caught:
        play(Breaks(), PATH, 0.01)
    assert "step()" in caught.value.why


def test_a_batch_with_a_nan_is_named_with_its_tick():
    class Breaks(Batched):
        def run(self, hips, dt):
            forces = np.zeros_like(hips)
            forces[7, 1] = np.nan
            return hips, forces

    with pytest.raises(RendererError, match="forces not finite") as caught:
        play(Breaks(), PATH, 0.01)
    assert caught.value.tick == 7
