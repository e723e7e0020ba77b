"""The closed loop of Figure 6.17: device, sampled renderer, and an operator who pushes and draws."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from hapticeval.devices.device import Device
from hapticeval.devices.imperfections import Imperfections, actuation, feeling, sensing
from hapticeval.devices.inner_loop import InnerLoop
from hapticeval.devices.integration import control, default_method
from hapticeval.devices.point_mass import PointMass
from hapticeval.errors import DomainError, InputError, RendererError, RunawayError
from hapticeval.recordings.recording import Recording
from hapticeval.renderer import Compiled, CompiledLaw, Explaining, Feeling, Renderer, SelfDriven
from hapticeval.scene import Scene
from hapticeval.simulation.playback import answered, ask, declared, start
from hapticeval.stimulus.stimulus import Experiment, sample_times
from hapticeval.types import Array

RUNAWAY = 1e6
"""Model sizes that a point mass, and radians that a joint, may be away from the start: no controller means more."""


class _End(NamedTuple):
    """Where and why a run ended before its time."""

    tick: int
    error: DomainError


def drive(renderer: Renderer | SelfDriven, experiment: Experiment, scene: Scene, dt: float) -> Recording:
    """Run `experiment` on the scene's robot, with the renderer sampled every `dt` seconds.

    A tick: the sensors are read, the renderer answers, the inner loop makes torques of its force, and the motors hold
    them to the next tick, while the device moves as it would in continuous time. The scene's imperfections come in
    where they do in the world: the encoders and the filtered velocity before the renderer, saturation and then delay
    after the inner loop, friction in the joints. Until the delay has passed, the motors give nothing.

    The operator's prescribed force and the hand's path are taken at the ticks and run straight in between. The channel
    `force` is the renderer's, `operator_force` the mean over the tick that follows the sample, and `joint_torque` what
    the motors really give, or its mean where a delay changes it within the tick.

    A renderer that offers a compiled law is run without Python, with the same numbers. A state in mid-run that renderer
    or device is not defined at ends the run there: `meta["ended"]` says at which `tick` and `time`, `what` and `why`,
    and the recording holds what was before that tick.

    Raises `DomainError` for a start outside of where they are defined, `InputError` for one in another dimension than
    the device's, and `RendererError`, naming tick and HIP, when the renderer breaks or when it drives the device out of
    the number range.
    """
    if not isinstance(renderer, Renderer):
        return answered(renderer, experiment, dt)
    device = scene.robot
    if experiment.dimension != device.dimension:
        raise InputError(
            f"the experiment is in {experiment.dimension}D, the {device.name} moves in {device.dimension}D",
            why="hand and device must move in the same space",
        )
    law = renderer.law if isinstance(renderer, Compiled) else None
    if law is None and isinstance(device, PointMass) and _plain(experiment, scene):
        return _drive_point_mass(renderer, experiment, device, dt, reach=RUNAWAY * scene.model.size)
    return _drive_device(renderer, law, experiment, scene, device, dt)


def _plain(experiment: Experiment, scene: Scene) -> bool:
    """Whether a point mass is ideal, and under forces that run straight: then its integral is exact."""
    return (
        scene.inner_loop is not InnerLoop.LINEARISED
        and experiment.hand is None
        and scene.imperfections == Imperfections()
    )


def _drive_point_mass(
    renderer: Renderer, experiment: Experiment, device: PointMass, dt: float, *, reach: float
) -> Recording:
    """The plain case, without kernels: what a small renderer in Python costs is its own time."""
    time = sample_times(experiment.duration, dt)
    count = time.size
    push = experiment.operator_force(np.append(time, count * dt))
    hips, ihips, forces, velocities = (np.empty((count, experiment.dimension)) for _ in range(4))
    hip, velocity = experiment.position, experiment.velocity
    start(renderer, hip)
    end = None
    for tick in range(count):
        try:
            ihip, force = ask(renderer, tick, hip, velocity, dt)
        except DomainError as error:
            end = _ended(tick, error)
            break
        hips[tick], ihips[tick], forces[tick], velocities[tick] = hip, ihip, force, velocity
        hip, velocity = device.advance(hip, velocity, force, push[tick], push[tick + 1], dt)
        if not abs(hip - experiment.position).max() < reach:
            raise _ran_away(tick, hips[tick], hip)
    channels = {
        "hip": hips,
        "ihip": ihips,
        "force": forces,
        "velocity": velocities,
        "operator_force": 0.5 * (push[:-1] + push[1:]),
    }
    return _recorded(renderer, time, channels, dt, end)


def _drive_device(
    renderer: Renderer, law: CompiledLaw | None, experiment: Experiment, scene: Scene, device: Device, dt: float
) -> Recording:
    """Any device and any effect, by compiled kernels; the renderer by its own, where it has any."""
    from hapticeval.simulation import kernels as kernels

    time = sample_times(experiment.duration, dt)
    loop = _Loop(experiment, scene, device, time, dt)
    loop.begin()
    start(renderer, loop.out[kernels.MEASURED_HIP, 0])
    end = None
    if law is None:
        feels = renderer if isinstance(renderer, Feeling) and loop.feeling is not None else None
        for tick in range(time.size):
            if tick > 0 and loop.sense(tick) == kernels.OUTSIDE:
                end = _ended(tick, loop.outside())
                break
            if feels is not None:
                feels.feel(loop.out[kernels.MEASURED_FORCE, tick].copy())
            try:
                loop.out[kernels.IHIP, tick], loop.out[kernels.FORCE, tick] = ask(
                    renderer, tick, loop.out[kernels.MEASURED_HIP, tick], loop.out[kernels.MEASURED_SPEED, tick], dt
                )
            except DomainError as error:
                end = _ended(tick, error)
                break
            if loop.act(tick) != kernels.DONE:
                raise _ran_away(tick, loop.out[kernels.HIP, tick], loop.state[kernels.JOINTS])
    else:
        tick, status = loop.run(law)
        if status == kernels.OUTSIDE:
            end = _ended(tick, loop.outside())
        elif status == kernels.RAN_AWAY:
            raise _ran_away(tick, loop.out[kernels.HIP, tick], loop.state[kernels.JOINTS])
        elif status == kernels.NOT_FINITE:
            raise _not_finite(tick, loop.out[:, tick])
        elif status >= kernels.REFUSED:
            end = _ended(tick, _refused(law, status - kernels.REFUSED + 1, loop.out[kernels.MEASURED_HIP, tick]))
    return _recorded(renderer, time, loop.channels(), dt, end)


def _refused(law: CompiledLaw, number: int, hip: Array) -> DomainError:
    """What a law's refusal number says."""
    return DomainError(
        law.refusals.get(number, f"the renderer's law refuses: number {number}"),
        why=f"the hand is at ({', '.join(f'{x:.6g}' for x in hip)}) m, where the renderer is not defined",
        todo="start nearer to the surface, hold on stiffer, or push less",
    )


def _ended(tick: int, error: DomainError) -> _End:
    """The end of a run in its middle; at its very start there is nothing to keep, and the error is raised."""
    if tick == 0:
        raise error
    return _End(tick, error)


def _recorded(renderer: Renderer, time: Array, channels: Mapping[str, Array], dt: float, end: _End | None) -> Recording:
    meta: dict[str, Any] = {"source": "experiment", "dt": dt, **declared(renderer)}
    count = time.size
    if end is not None:
        count = end.tick
        meta["ended"] = {
            "tick": end.tick,
            "time": float(time[end.tick]),
            "what": end.error.what,
            "why": end.error.why,
        }
    recording = Recording(time[:count], {name: values[:count] for name, values in channels.items()}, meta=meta)
    if not isinstance(renderer, Explaining):
        return recording
    told = renderer.signals(recording)
    more = {name: values for name, (_, values) in told.items()}
    signals = {name: signal for name, (signal, _) in told.items()}
    return Recording(recording.time, {**recording.channels, **more}, meta=meta, signals=signals)


def _ran_away(tick: int, hip: Array, joints: Array) -> RunawayError:
    return RunawayError(
        f"the closed loop ran away: the next joint positions are {joints}",
        tick=tick,
        hip=hip,
        why="the renderer's force feeds energy into the device without end",
        todo="lower the gains, or sample faster",
    )


def _not_finite(tick: int, planes: Array) -> RendererError:
    """In the words of `playback.ask`."""
    from hapticeval.simulation.kernels import FORCE, IHIP, MEASURED_HIP

    return RendererError(
        f"the renderer's answer is not finite: IHIP {planes[IHIP]}, force {planes[FORCE]}",
        tick=tick,
        hip=planes[MEASURED_HIP],
        why="a number that is not finite would reach the motors",
    )


class _Loop:
    """A run's arrays, and the kernels that work on them."""

    def __init__(self, experiment: Experiment, scene: Scene, device: Device, time: Array, dt: float) -> None:
        from hapticeval.compiled import DYNAMICS, KINEMATICS, MARGIN, first_class
        from hapticeval.devices import dynamics_kernels as motion
        from hapticeval.simulation import kernels as kernels

        self.kernels = kernels
        self.device = device
        self.experiment = experiment
        self.imperfections = scene.imperfections
        count, size = time.size, device.dimension
        ends = np.append(time, count * dt)
        hand = experiment.hand
        exact = isinstance(device, PointMass) and hand is None and scene.imperfections.friction is None
        method = default_method()
        code = device.kernels
        self.kinematics = first_class(code.kinematics, KINEMATICS)
        self.dynamics = first_class(code.dynamics, DYNAMICS)
        self.margin = first_class(code.margin, MARGIN)
        self.parameters = device.parameters
        reach = RUNAWAY * (scene.model.size if isinstance(device, PointMass) else 1.0)
        self.settings = np.array([float(scene.inner_loop.code), scene.mass, dt, reach])
        self.exact = self.parameters[:1].copy() if exact else None
        push = experiment.operator_force(ends)
        self.push = np.ascontiguousarray(push) if hand is not None or push.any() else None
        self.path = None if hand is None else hand.desired(ends)
        self.grip = None if hand is None else np.array([hand.stiffness, hand.damping])
        self.sensing = sensing(scene.imperfections, dt)
        self.actuation = actuation(scene.imperfections, dt)
        friction = scene.imperfections.friction
        self.friction = None if friction is None else np.full(size, friction)
        self.noise, self.feeling = feeling(scene.imperfections.force_sensor, (count, size), dt)
        self.table, self.control, self.pace = method.table, control(method), np.array([dt])
        self.state = np.zeros((kernels.ROWS, size))
        self.squares = np.empty((motion.SQUARES, size, size))
        self.rows = np.zeros((motion.ROWS, size))
        self.stages = np.empty((method.b.size, size))
        self.out = np.zeros((kernels.PLANES, count, size))

    def begin(self) -> None:
        """Put the device where the experiment starts. Raises `DomainError` where it cannot be."""
        joints = self.device.joints(self.experiment.position)
        self.state[self.kernels.JOINTS] = self.state[self.kernels.START] = joints
        if self.device.margin(joints) > 0.0:
            self.state[self.kernels.RATES] = np.linalg.solve(self.device.jacobian(joints), self.experiment.velocity)
        if self.sense(0) == self.kernels.OUTSIDE:
            raise self.outside()

    def outside(self) -> DomainError:
        """Why the device is not defined where it is."""
        joints = self.state[self.kernels.JOINTS]
        check = getattr(self.device, "check", None)
        if check is not None:
            try:
                check(joints)
            except DomainError as error:
                return error
        return DomainError(
            f"the {self.device.name} is outside of its functional configuration space: joints {joints}",
            why=f"its margin to joint limits and singularities is {self.device.margin(joints):.3g}",
        )

    def sense(self, tick: int) -> int:
        """Read the sensors."""
        return self.kernels.sense(
            tick, self.kinematics, self.margin, self.parameters, self.settings, self.push, self.path, self.grip,
            self.sensing, self.noise, self.feeling, self.state, self.squares, self.out,
        )  # fmt: skip

    def act(self, tick: int) -> int:
        """Drive the motors, and move."""
        return self.kernels.act(
            tick, self.kinematics, self.dynamics, self.parameters, self.settings, self.exact, self.push, self.path,
            self.grip, self.actuation, self.friction, self.feeling, self.table, self.control, self.pace, self.state,
            self.squares, self.rows, self.stages, self.out,
        )  # fmt: skip

    def run(self, law: CompiledLaw) -> tuple[int, int]:
        """All ticks with a compiled law: the tick that the run ended at, and how."""
        from hapticeval.compiled import LAW, first_class

        return self.kernels.run(
            first_class(law.function, LAW), law.data, self.kinematics, self.dynamics, self.margin, self.parameters,
            self.settings, self.exact, self.push, self.path, self.grip, self.sensing, self.actuation, self.friction,
            self.noise, self.feeling, self.table, self.control, self.pace, self.state, self.squares, self.rows,
            self.stages, self.out,
        )  # fmt: skip

    def channels(self) -> dict[str, Array]:
        """What the recording holds of the run."""
        kernels, effects = self.kernels, self.imperfections
        planes = {
            "hip": kernels.HIP,
            "ihip": kernels.IHIP,
            "force": kernels.FORCE,
            "velocity": kernels.SPEED,
            "operator_force": kernels.OPERATOR,
        }
        if effects.encoder_step is not None:
            planes["measured_hip"] = kernels.MEASURED_HIP
        if self.sensing is not None:
            planes["measured_velocity"] = kernels.MEASURED_SPEED
        if self.feeling is not None:
            planes["measured_force"] = kernels.MEASURED_FORCE
        if not isinstance(self.device, PointMass):
            planes |= {"joint_position": kernels.JOINT, "joint_velocity": kernels.RATE, "joint_torque": kernels.TORQUE}
        return {name: self.out[plane] for name, plane in planes.items()}
