"""The loop that runs a renderer on hardware and records it."""

from __future__ import annotations

import contextlib
import gc
import time
from array import array
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from hapticeval.errors import DomainError, HapticevalError
from hapticeval.hardware.device import Guarded, HardwareDevice
from hapticeval.hardware.safety import RESUMED_AFTER, Limiter, Watchdog
from hapticeval.hardware.wiring import Kinematics, Rates, Wiring
from hapticeval.recordings.channels import Signal
from hapticeval.recordings.recorder import Recorder
from hapticeval.renderer import Renderer
from hapticeval.scene import Scene
from hapticeval.simulation.checked_calls import reset_checked, step_checked
from hapticeval.stimulus.stimulus import PHASE_EVENT
from hapticeval.types import Array

WORLD_CHANNELS = ("hip", "velocity", "ihip", "force", "sent_force")
JOINT_CHANNELS = ("joint_position", "commanded_torque", "joint_torque")

WARM_DISTANCE = 1e-3
"""Metres on either side of the surface at which everything is run once before it counts."""


def channels(dimension: int) -> dict[str, int]:
    """Return what a live run records, and in how many columns, in the order of `append`."""
    return dict.fromkeys((*WORLD_CHANNELS, *JOINT_CHANNELS, "raw"), dimension)


def signals(wiring: Wiring) -> dict[str, Signal]:
    """Return the signal of `raw`: encoder counts, or angles as the hardware has them."""
    unit = "rad" if wiring.counts_per_turn is None else "counts"
    return {"raw": Signal(unit, "raw joint positions as the hardware gave them", "joint")}


@dataclass(frozen=True)
class LiveRun:
    """How a live run went: `cycles` of the loop, `missed` ones of the hardware that the loop was too late for, and what
    `ended` it before its time, if anything did.

    `notes` say what limits took away and which readings were dropped, a line each. `median` and `longest` (s) are how
    long a step took, from what was read to the row of it; zero where there was none.
    """

    cycles: int
    missed: int
    ended: str = ""
    median: float = 0.0
    longest: float = 0.0
    notes: tuple[str, ...] = ()


def warm(wiring: Wiring, renderer: Renderer, scene: Scene) -> None:
    """Run once what a cycle runs, inside the surface and outside, so that code is compiled before time counts.

    Raises `RendererError` for a renderer that breaks already.
    """
    device, kinematics, rates = wiring.device, Kinematics(wiring.device), Rates(wiring.device.dimension)
    home = device.position(np.zeros(device.dimension))
    # The surface next to the robot's home: a place that the robot can reach, as a rule.
    frame = scene.model.boundary.closest_point(home[None])
    for side in (-WARM_DISTANCE, WARM_DISTANCE):
        with contextlib.suppress(DomainError):  # of a point that the robot or the renderer does not have
            joints = device.joints(frame.foot[0] + side * frame.normal[0])
            kinematics.check(joints)
            hip, velocity = kinematics.hand(joints, rates.after(scene.sampling_time, joints))
            reset_checked(renderer, hip)
            _, force = step_checked(renderer, 0, hip, velocity, scene.sampling_time)
            torque = scene.inner_loop.torque(device, joints, np.zeros_like(joints), force, mass=scene.mass)
            wiring.commands(torque)


def run(
    connect: Callable[[], HardwareDevice],
    wiring: Wiring,
    renderer: Renderer,
    scene: Scene,
    recorder: Recorder,
    *,
    cycles: int,
    tell: Callable[[int], None] | None = None,
    patience: float | None = None,
    refusing: bool = False,
    phases: Sequence[tuple[float, str]] = (),
) -> LiveRun:
    """Run for `cycles` cycles of the hardware: read, project, answer, limit, command, record; then stop the motors.

    The hardware is opened by `connect` when all else is ready, code compiled and loaded. Its motors are stopped
    whatever happens, see `Guarded`. HIP and velocity come from the encoders alone, velocity by `Rates`; the scene's
    inner loop makes torques of the renderer's force, of which the wiring's limits leave what is sent. A row has the
    hardware's stamp, and what was commanded beside what was sent.

    A cycle may take `patience` seconds, the wiring's `silent_cycles` where none is given: a simulation without a clock
    needs more. Where `refusing`, a command above a limit ends the run. Of `phases`, each a time (s) and what begins
    then, events are recorded.

    Ctrl-C, a recorder whose writer dies, and a renderer that is led out of where it is defined, end the run: `ended`
    gives the reason. Raises `WatchdogError` where a reading or a command is doubtful, `HapticevalError` where the
    hardware goes, or stands outside of its workspace at the start, and `RendererError` with the tick when the renderer
    breaks. The motors are at rest then, the rows up to there recorded, and the notes of the error are those of a run.
    """
    # Made before the hardware is opened, so that nothing is built while its cycles count.
    loop = _Loop(wiring, renderer, scene, recorder, refusing=refusing)
    patience = wiring.silent_cycles * scene.sampling_time if patience is None else patience
    coming = deque(sorted(phases))
    ended = ""
    failure: HapticevalError | None = None
    warm(wiring, renderer, scene)
    gc.freeze()  # what there is stays: a collection in mid-run then looks at little
    try:
        with Guarded(connect(), wiring.device.dimension, scene.sampling_time, patience) as robot:
            try:
                # Cycles of the hardware: a run lasts as long whether the loop was late or not.
                while loop.tick + loop.missed < cycles:
                    reading = robot.read()
                    loop.step(reading.nanoseconds, reading.sequence, reading.raw, robot.write)
                    while coming and coming[0][0] <= (loop.tick + loop.missed - 1) * scene.sampling_time:
                        recorder.event(PHASE_EVENT, coming.popleft()[1], at=loop.stamp)
                    if tell is not None:
                        tell(loop.tick + loop.missed)
                    if recorder.failed:
                        ended = f"{recorder.failed}, and nothing is recorded any more"
                        break
            except KeyboardInterrupt:
                ended = "interrupted by the user"
            except DomainError as error:
                ended, failure = _reason(error), _cannot_start(error) if loop.tick == 0 else None
            except HapticevalError as error:
                off_workspace = loop.tick == 0 and isinstance(error.__cause__, DomainError)
                ended, failure = _reason(error), _cannot_start(error) if off_workspace else error
            notes = (*loop.limiter.describe().splitlines(), *robot.dropped())
            for note in notes:
                recorder.event("note", note, at=loop.stamp)
            if ended:
                recorder.event("ended", ended, at=loop.stamp)
            if failure is not None:
                for note in notes:
                    failure.add_note(note)
                raise failure
    finally:
        gc.unfreeze()
    # s; a run without a step took 0.
    took = 1e-9 * np.array(loop.took or [0])
    return LiveRun(loop.tick, loop.missed, ended, float(np.median(took)), float(np.max(took)), notes)


def _reason(error: HapticevalError) -> str:
    """Return why a run ended, in one line."""
    return f"{error.what}: {error.why}" if error.why else error.what


def _cannot_start(error: HapticevalError) -> HapticevalError:
    """Return the error of a first pose that is outside already: nothing was felt, so it is no end of a run."""
    return HapticevalError(
        "the run cannot start where the robot is",
        why=_reason(error),
        todo="move the robot; if it is not there, see the wiring: offsets, directions, counts a turn",
    )


class _Loop:
    """One cycle after the other of a live run: what each needs, and what it leaves to the next."""

    def __init__(self, wiring: Wiring, renderer: Renderer, scene: Scene, recorder: Recorder, *, refusing: bool) -> None:
        self.wiring, self.renderer, self.scene, self.recorder = wiring, renderer, scene, recorder
        self.kinematics = Kinematics(wiring.device)
        self.limiter = Limiter(wiring, scene.sampling_time, refusing=refusing)
        self.watchdog = Watchdog(wiring, self.kinematics)
        self.rates = Rates(wiring.device.dimension)
        self.tick = self.missed = 0
        self.last = 0
        self.stamp: int | None = None
        """ns, of the hardware's clock, which need not be this computer's."""
        self.took = array("q")
        """Nanoseconds of each step."""

    def step(self, stamp: int, sequence: int, raw: Array, write: Callable[[Array], None]) -> None:
        """Run one cycle: from raw positions `raw` (N,) to motor commands, and a row with the hardware's `stamp` (ns).

        In between are joints (rad), HIP (m), force (N) and torques (N m).
        """
        begun = time.perf_counter_ns()
        scene, dt = self.scene, self.scene.sampling_time
        # Cycles that the hardware counted and the loop never saw.
        late = sequence - self.last - 1 if self.tick else 0
        if late:
            self.recorder.missed(late)
            self.missed += late
        self.last, self.stamp = sequence, stamp
        joints = self.wiring.joints(raw)
        self.watchdog.check_joints(joints)
        # Joint velocities over the time that has really passed, missed cycles included.
        rates = self.rates.after(dt * (late + 1), joints)
        hip, velocity = self.kinematics.hand(joints, rates)
        self.watchdog.check_hand(hip, dt * (late + 1))
        if self.tick == 0:
            reset_checked(self.renderer, hip)
        ihip, force = step_checked(self.renderer, self.tick, hip, velocity, dt, may_refuse=self.tick == 0)

        def torque_of(force: Array) -> Array:
            """Return tau = J^T F (N,), N m, of (2.8), of a force (N,), N, with what the inner loop adds."""
            return scene.inner_loop.torque(self.wiring.device, joints, rates, force, mass=scene.mass)

        sent = self.limiter.limit(force, torque_of, resumed=self.tick == 0 or late > RESUMED_AFTER)
        # Written before recording: the hand waits for the force and not for the row.
        write(self.wiring.commands(sent.torque))
        self.recorder.append(hip, velocity, ihip, force, sent.force, joints, sent.commanded, sent.torque, raw, at=stamp)
        self.tick += 1
        self.took.append(time.perf_counter_ns() - begun)
