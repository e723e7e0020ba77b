"""The closed loop of Figure 6.17: device, sampled renderer and an operator who pushes."""

from __future__ import annotations

import numpy as np

from hapticeval.devices.point_mass import PointMass
from hapticeval.errors import RendererError
from hapticeval.playback import answered, ask, declared, start
from hapticeval.recordings.recording import Recording
from hapticeval.renderer import Renderer, SelfDriven
from hapticeval.stimulus import Experiment, sample_times


def drive(renderer: Renderer | SelfDriven, experiment: Experiment, device: PointMass, dt: float) -> Recording:
    """Run `experiment` with the renderer sampled every `dt` seconds and its force held in between.

    The device moves by exact integration between samples. Raises `RendererError`, naming tick and HIP, when the
    renderer breaks or when it drives the device out of the number range.
    """
    if isinstance(renderer, SelfDriven):
        return answered(renderer, experiment, dt)
    time = sample_times(experiment.duration, dt)
    count = time.size
    push = experiment.operator_force(np.append(time, count * dt))
    shape = (count, experiment.dimension)
    hips, ihips, forces, velocities = (np.empty(shape) for _ in range(4))
    hip, velocity = experiment.position, experiment.velocity
    start(renderer, hip)
    for tick in range(count):
        ihip, force = ask(renderer, tick, hip, velocity, dt)
        hips[tick], ihips[tick], forces[tick], velocities[tick] = hip, ihip, force, velocity
        hip, velocity = device.advance(hip, velocity, force, push[tick], push[tick + 1], dt)
        if not abs(hip).max() < 1e6:
            raise RendererError(
                f"the closed loop ran away: the next HIP is {hip} m",
                tick=tick,
                hip=hips[tick],
                why="the renderer's force feeds energy into the device without end",
                todo="lower the gains, or sample faster",
            )
    channels = {
        "hip": hips,
        "ihip": ihips,
        "force": forces,
        "velocity": velocities,
        "operator_force": 0.5 * (push[:-1] + push[1:]),
    }
    return Recording(time, channels, meta={"source": "experiment", "dt": dt, **declared(renderer)})
