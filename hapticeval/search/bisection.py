"""Whether an IHIP really jumps: the place is bisected to a nanometre of the hand's path, where only a jump is left."""

from __future__ import annotations

import numpy as np

from hapticeval.phenomena.decisions import LAG_TICKS
from hapticeval.renderer import Renderer
from hapticeval.runner.judging import make_renderer
from hapticeval.runner.work import seed_all
from hapticeval.search.trial import Fault, factory_of
from hapticeval.simulation.playback import run_path
from hapticeval.stimulus.stimulus import Path
from hapticeval.suite.case import Case
from hapticeval.types import Array

FINEST_STEP = 1e-9
"""Distance (m) of the two HIPs between which a jump is placed."""

REMAINING_SHARE = 0.5
"""Share of the jump between two samples that must be left between HIPs a nanometre apart."""


def jump_between(renderer: str, seed: int, case: Case, fault: Fault) -> tuple[Array, Array, float] | None:
    """Return two HIPs (N,), m, a nanometre apart between which the IHIP jumps, and how far it does, m.

    `fault` says at which time of the path the jump was seen. Each time the hand is led along the path to the sample
    before that, and on to a point between it and the next sample. There it rests until a proxy that lags has come.
    Bisection of that point closes in on the jump.

    None where the renderer answers a path as a whole, where the case is no path, and where less than half of the jump
    is left: then the IHIP moves fast there, and does not jump.
    """
    scene = case.build_scene()
    renderer_instance = make_renderer(factory_of(renderer), scene)
    path = case.build_stimulus(scene, renderer_instance)
    if fault.time is None or not isinstance(renderer_instance, Renderer) or not isinstance(path, Path):
        return None
    hips = path.sampled(scene.sampling_time)[1]
    tick = round(fault.time / scene.sampling_time)

    def answer(before: int, hip: Array) -> Array:
        """Return the IHIP (N,), m, with the hand at rest at `hip` (N,), m, after the path up to sample `before`."""
        seed_all(seed)
        hand_path = np.vstack([hips[: before + 1], np.tile(hip, (LAG_TICKS + 1, 1))])
        # v_i = (x_i - x_(i-1)) / dt, m/s, and zero at the start
        velocity = np.diff(hand_path, axis=0, prepend=hand_path[:1]) / scene.sampling_time
        return np.asarray(run_path(renderer_instance, hand_path, velocity, scene.sampling_time, scene=scene).ihip[-1])

    # Of a proxy that lags the hand has made the step before the IHIP jumps.
    for tick_after in range(min(tick, len(hips) - 1), max(tick - LAG_TICKS - 1, 0), -1):
        hip_low, hip_high = hips[tick_after - 1], hips[tick_after]
        ihip_low, ihip_high = answer(tick_after - 1, hip_low), answer(tick_after - 1, hip_high)
        jump = float(np.linalg.norm(ihip_high - ihip_low))
        if fault.value is None or jump < REMAINING_SHARE * fault.value:
            continue
        # The jump is between HIPs low and high: the middle goes to the side whose IHIP is nearer to its own.
        while np.linalg.norm(hip_high - hip_low) > FINEST_STEP:
            hip_middle = 0.5 * (hip_low + hip_high)
            # Neighbouring floats have nothing between them.
            if np.array_equal(hip_middle, hip_low) or np.array_equal(hip_middle, hip_high):
                break
            ihip_middle = answer(tick_after - 1, hip_middle)
            if np.linalg.norm(ihip_middle - ihip_low) < np.linalg.norm(ihip_middle - ihip_high):
                hip_low, ihip_low = hip_middle, ihip_middle
            else:
                hip_high, ihip_high = hip_middle, ihip_middle
        final_jump = float(np.linalg.norm(ihip_high - ihip_low))
        # What shrinks with the HIP's step is a steep place and no jump.
        return (hip_low, hip_high, final_jump) if final_jump >= REMAINING_SHARE * jump else None
    return None
