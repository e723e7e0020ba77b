"""The loop that runs a renderer on hardware and records it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from hapticeval.devices.sensing import blend
from hapticeval.hardware.device import HardwareDevice
from hapticeval.hardware.wiring import Wiring
from hapticeval.playback import ask, start
from hapticeval.recordings.channels import Signal
from hapticeval.recordings.recorder import Recorder
from hapticeval.renderer import Renderer
from hapticeval.scene import Scene
from hapticeval.types import Array

WORLD, JOINT = ("hip", "velocity", "ihip", "force"), ("joint_position", "joint_torque")
RAW = Signal("1", "raw joint positions as the hardware gave them: encoder counts, or rad", "joint")


def channels(dimension: int) -> dict[str, int]:
    """What a session records, and in how many columns, in the order of `append`."""
    return dict.fromkeys((*WORLD, *JOINT, "raw"), dimension)


SIGNALS = {"raw": RAW}


@dataclass(frozen=True)
class Session:
    """How a session went: `cycles` of the loop, and `missed` ones of the hardware that the loop was too late for."""

    cycles: int
    missed: int


def run(
    hardware: HardwareDevice,
    wiring: Wiring,
    renderer: Renderer,
    scene: Scene,
    recorder: Recorder,
    *,
    cycles: int,
    cutoff: float = 100.0,
    tell: Callable[[int], None] | None = None,
) -> Session:
    """Run `cycles` cycles: read, project, answer, command, record; the motors are stopped whatever happens.

    HIP and velocity come from the encoders alone, velocity as their difference through a first-order low-pass of
    `cutoff` Hz; the scene's inner loop makes torques of the renderer's force. A row has the hardware's stamp.
    Raises what the hardware raises when it goes, and `RendererError` with the tick when the renderer breaks.
    """
    device, dt = wiring.device, scene.sampling_time
    share = blend(cutoff, dt)
    rates = np.zeros(device.dimension)
    before: Array | None = None
    last, missed, done = 0, 0, 0
    try:
        for tick in range(cycles):
            reading = hardware.read()
            joints = wiring.joints(reading.raw)
            if before is None:
                start(renderer, device.position(joints))
            else:
                lost = reading.sequence - last - 1
                if lost > 0:
                    recorder.missed(lost)
                    missed += lost
                rates = rates + share * ((joints - before) / (dt * max(1, lost + 1)) - rates)
            before, last = joints, reading.sequence
            hip, velocity = device.position(joints), device.jacobian(joints) @ rates
            ihip, force = ask(renderer, tick, hip, velocity, dt)
            torque = scene.inner_loop.torque(device, joints, rates, force, mass=scene.mass)
            hardware.write(wiring.commands(torque))
            recorder.append(hip, velocity, ihip, force, joints, torque, reading.raw, at=reading.nanoseconds)
            done += 1
            if tell is not None:
                tell(done)
    except KeyboardInterrupt:
        recorder.event("ended", "interrupted by the user")
    finally:
        hardware.close()
    return Session(done, missed)
