"""The closed loop of Figure 6.17: device, sampled renderer, and an operator who pushes and draws."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from hapticeval.devices.device import Device, checked_joints
from hapticeval.devices.inner_loop import InnerLoop
from hapticeval.devices.integration import default_method
from hapticeval.devices.point_mass import PointMass
from hapticeval.effects.effect import Stage
from hapticeval.errors import (
    DomainError,
    InputError,
    RendererError,
    RunawayError,
    coordinates,
    in_m,
    renderer_errors,
)
from hapticeval.pulse import note_run
from hapticeval.recordings.recording import Event, Recording
from hapticeval.renderer import AnyRenderer, CompiledStep, WrappedRenderer, wrapped
from hapticeval.scene import Scene
from hapticeval.simulation.checked_calls import (
    not_finite,
    observe_force_checked,
    reported_contact,
    reset_checked,
    simulate_checked,
    step_checked,
)
from hapticeval.simulation.playback import contact_channel, with_poses
from hapticeval.stimulus.stimulus import PHASE_EVENT, Experiment, sample_times
from hapticeval.types import Array

if TYPE_CHECKING:
    from hapticeval.simulation.kernels import Loop

RUNAWAY = 1e6
"""Model sizes that a point mass, and radians that a joint, may be away from the start: no controller means more."""


class _End(NamedTuple):
    """Where and why a run ended before its time."""

    tick: int
    error: DomainError | RunawayError


def simulate_closed_loop(renderer: AnyRenderer, experiment: Experiment, scene: Scene, dt: float) -> Recording:
    """Run `experiment` on the scene's robot, with the renderer sampled every `dt` seconds.

    A tick: the sensors are read, the renderer answers, the inner loop makes torques of its force, and the motors hold
    them to the next tick, while the device moves as it would in continuous time.

    The scene's effects come in at their `stage`: those of the sensors before the renderer, those of the motors after
    the inner loop.

    The operator's prescribed force and the hand's path are taken at the ticks and run straight in between. The channel
    `force` is the renderer's, `operator_force` the mean over the tick that follows the sample, and `joint_torque` what
    the motors really give, or its mean where a delay changes it within the tick.

    Where the body slides evenly the loop runs in its frame, in which a point mass does the same.

    A renderer that offers a compiled law is run without Python, with the same numbers.

    A state in mid-run that renderer or device is not defined at ends the run there, and so does a tick that drives the
    device farther than `RUNAWAY`: `meta["ended"]` says at which `tick` and `time`, `what` and `why`, and of a loop that
    did so `ran_away`, and the recording holds what was before that tick.

    Raises `DomainError` for a start outside of where they are defined, `RunawayError` for a loop that runs away in its
    first tick, `InputError` for a start in another dimension than the device's, and `RendererError`, naming tick and
    HIP, when the renderer breaks.
    """
    renderer = wrapped(renderer)
    if not renderer.steps:
        return with_poses(simulate_checked(renderer, experiment, dt), scene)
    device = scene.robot
    if experiment.dimension != device.dimension:
        raise InputError(
            f"the experiment is in {experiment.dimension}D, the {device.name} moves in {device.dimension}D",
            why="hand and device must move in the same space",
        )
    if renderer.law is None and isinstance(device, PointMass) and _has_exact_integral(experiment, scene):
        reach = RUNAWAY * scene.model.size
        return with_poses(_drive_point_mass(renderer, experiment, device, dt, reach=reach), scene)
    return with_poses(_drive_device(renderer, experiment, scene, dt), scene)


def _has_exact_integral(experiment: Experiment, scene: Scene) -> bool:
    """Whether a point mass is ideal, and under forces that run straight: then its integral is exact."""
    return (
        scene.inner_loop is not InnerLoop.LINEARISED
        and experiment.hand is None
        and all(effect.stage in (None, Stage.ANSWER) for effect in scene.effects)
    )


def _drive_point_mass(
    renderer: WrappedRenderer, experiment: Experiment, device: PointMass, dt: float, *, reach: float
) -> Recording:
    """Run the plain case without kernels: with a small renderer in Python they would take longer than they save."""
    time = sample_times(experiment.duration, dt)
    count = time.size
    push = experiment.operator_force(np.append(time, count * dt))  # also at the end of the last tick
    hips, ihips, forces, velocities = (np.empty((count, experiment.dimension)) for _ in range(4))
    contact = np.empty(count)
    hip, velocity = experiment.position, experiment.velocity
    reset_checked(renderer, hip)
    end = None
    for tick in range(count):
        try:
            ihip, force = step_checked(renderer, tick, hip, velocity, dt, may_refuse=tick == 0)
        except DomainError as error:
            end = _end_of_run(tick, error)
            break
        hips[tick], ihips[tick], forces[tick], velocities[tick] = hip, ihip, force, velocity
        contact[tick] = reported_contact(renderer)
        # F_r is held over the tick, the push runs straight: the integral is exact
        hip, velocity = device.advance(hip, velocity, force, push[tick], push[tick + 1], dt)
        if not abs(hip - experiment.position).max() < reach:  # also for nan
            end = _end_of_run(tick, _runaway_error(tick, hips[tick], hip))
            break
    channels = {
        "hip": hips,
        "ihip": ihips,
        "force": forces,
        "velocity": velocities,
        "operator_force": 0.5 * (push[:-1] + push[1:]),  # the mean over the tick of a force that runs straight
    }
    return _recording_of(renderer, experiment, time, channels, dt, end, contact)


def _drive_device(renderer: WrappedRenderer, experiment: Experiment, scene: Scene, dt: float) -> Recording:
    """Run any device with any effect in compiled kernels, and the renderer in its own compiled law where it has one."""
    from hapticeval.laws import law_value
    from hapticeval.simulation import kernels

    time, law = sample_times(experiment.duration, dt), renderer.law
    loop = loop_of(experiment, scene, dt)
    out = loop.out
    out.contact[:] = np.nan  # unknown, until a renderer reports it
    reset_checked(renderer, out.measured_hip[0])
    end = None
    if law is None:
        end = _ask_tick_by_tick(renderer, loop, scene.robot, dt)
    else:
        loop = loop._replace(reported=law.contact)
        note_run(0)
        tick, status, number = kernels.run(law_value(law.function, law.data), law.data, loop)
        if status == kernels.OUTSIDE:
            end = _end_of_run(tick, _outside_error(scene.robot, loop.state.joints))
        elif status == kernels.RAN_AWAY:
            end = _end_of_run(tick, _runaway_error(tick, out.hip[tick], loop.state.joints))
        elif status == kernels.NOT_FINITE:
            raise not_finite(tick, out.measured_hip[tick], out.ihip[tick], out.force[tick])
        elif status == kernels.BROKE:
            raise RendererError(
                f"the renderer's compiled step returned {number}",
                tick=tick,
                hip=out.measured_hip[tick],
                why="it is below 0: the renderer broke",
            )
        elif status == kernels.LEFT_DOMAIN:
            end = _end_of_run(tick, _domain_exit_error(law, number, out.measured_hip[tick]))
    return _recording_of(renderer, experiment, time, _channels_of(loop, scene), dt, end, out.contact[:, 0])


def _ask_tick_by_tick(renderer: WrappedRenderer, loop: Loop, device: Device, dt: float) -> _End | None:
    """Run a loop with a renderer in Python; return where and why it ended before its time."""
    from hapticeval.compiled import specialised
    from hapticeval.simulation import kernels

    act_and_sense = specialised(kernels.act_and_sense, loop, 0)
    out, joints = loop.out, loop.state.joints
    hips, velocities, pushes = out.measured_hip, out.measured_velocity, out.measured_force
    observes_force = loop.feeling is not None and renderer.observes_force
    for tick in range(out.hip.shape[0]):  # `loop_of` has sensed the first one
        if observes_force:
            observe_force_checked(renderer, tick, hips[tick], pushes[tick])
        try:
            out.ihip[tick], out.force[tick] = step_checked(
                renderer, tick, hips[tick], velocities[tick], dt, may_refuse=tick == 0
            )
        except DomainError as error:
            return _end_of_run(tick, error)
        out.contact[tick, 0] = reported_contact(renderer)
        status = act_and_sense(loop, tick)
        if status == kernels.RAN_AWAY:
            return _end_of_run(tick, _runaway_error(tick, out.hip[tick], joints))
        if status == kernels.OUTSIDE:
            return _end_of_run(tick + 1, _outside_error(device, joints))
    return None


def _domain_exit_error(law: CompiledStep, number: int, hip: Array) -> DomainError:
    """What a law says by its `number` of the hand, at `hip` (N,), m, having left its domain."""
    return DomainError(
        law.domain_exits.get(number, f"the hand left the domain of the renderer's law: number {number}"),
        why=f"the hand is at {in_m(hip)}, where the renderer is not defined",
        todo="start nearer to the surface, hold on stiffer, or push less",
    )


def _end_of_run(tick: int, error: DomainError | RunawayError) -> _End:
    """The end of a run in its middle; at its very start there is nothing to keep, and the error is raised."""
    if tick == 0:
        raise error
    return _End(tick, error)


def _recording_of(
    renderer: WrappedRenderer,
    experiment: Experiment,
    time: Array,
    channels: Mapping[str, Array],
    dt: float,
    end: _End | None,
    contact: Array,
) -> Recording:
    meta: dict[str, Any] = {"source": "experiment", "dt": dt, "quiet_from": experiment.quiet_from}
    meta |= renderer.meta
    count = time.size
    if end is not None:
        count = end.tick
        # the rows before the tick were answered: they are the recording
        meta["ended"] = {
            "tick": end.tick,
            "time": float(time[end.tick]),
            "what": end.error.what,
            "why": end.error.why,
        }
        if isinstance(end.error, RunawayError):
            meta["ended"]["ran_away"] = True
    kept_channels = {name: values[:count] for name, values in channels.items()} | contact_channel(contact[:count])
    phases = [Event(begin, PHASE_EVENT, name) for begin, name in experiment.phases if begin <= time[count - 1]]
    recording = Recording(time[:count], kept_channels, meta=meta, events=tuple(phases))
    if not renderer.has_diagnostics:
        return recording
    with renderer_errors("diagnostics()"):
        added = dict(renderer.diagnostics(recording))
    added_channels = {name: values for name, (_, values) in added.items()}
    signals = {name: signal for name, (signal, _) in added.items()}
    return replace(recording, channels={**recording.channels, **added_channels}, signals=signals)


def _runaway_error(tick: int, hip: Array, joints: Array) -> RunawayError:
    return RunawayError(
        f"the closed loop ran away: the next joint positions are {coordinates(joints)}",
        tick=tick,
        hip=hip,
        why="the renderer's force feeds energy into the device without end",
        todo="lower the gains, or sample faster",
    )


def loop_of(experiment: Experiment, scene: Scene, dt: float) -> Loop:
    """Assemble what the scene calls for into a loop, with the device where the experiment starts.

    Raises `DomainError` where it cannot be.
    """
    from hapticeval.devices.inner_loop_kernels import Inner
    from hapticeval.devices.motion_kernels import Grip, Load, advance_of, motion_of
    from hapticeval.simulation import kernels

    device, hand = scene.robot, experiment.hand
    time = sample_times(experiment.duration, dt)
    count, size = time.size, device.dimension
    # the effects of the surface are in the renderer's answers already
    parts = [
        (effect.stage, effect.part(count, size, dt))
        for effect in scene.effects
        if effect.stage not in (None, Stage.ANSWER)
    ]
    sensors, feeling, motors = (
        kernels.hook_of(part for stage, part in parts if stage is stage_of_hook)
        for stage_of_hook in (Stage.SENSE, Stage.FEEL, Stage.COMMAND)
    )
    frictions = [part.params for stage, part in parts if stage is Stage.JOINTS]
    ends = np.append(time, count * dt)  # the path and the push run straight to the end of the last tick too
    push = experiment.operator_force(ends)
    load = Load(
        dt,
        np.ascontiguousarray(push),
        None if hand is None else Grip(hand.desired(ends), np.array([hand.stiffness, hand.damping])),
        np.sum(frictions, axis=0) if frictions else None,
    )
    has_exact_integral = isinstance(device, PointMass) and hand is None and not frictions
    state = kernels.LoopState(*np.zeros((len(kernels.LoopState._fields), size)))
    joints = device.joints(experiment.position)
    state.joints[:] = state.start[:] = joints
    # q̇ = J⁻¹ ẏ: within the limits, as joints() makes sure, J is regular
    state.rates[:] = np.linalg.solve(device.jacobian(joints), experiment.velocity)
    motion = motion_of(device, load, default_method())
    loop = kernels.Loop(
        motion,
        Inner(scene.inner_loop.code, scene.mass, scene.believed_robot.parameters),
        sensors,
        feeling,
        motors,
        advance_of(motion, exact=has_exact_integral),
        RUNAWAY * (1.0 if device.turning else scene.model.size),
        state,
        kernels.LoopChannels(*np.zeros((len(kernels.LoopChannels._fields), count, size))),
    )
    if kernels.sense(loop, 0) == kernels.OUTSIDE:
        raise _outside_error(device, joints)
    return loop


def _outside_error(device: Device, joints: Array) -> DomainError:
    """Return why the device is not defined at `joints`."""
    try:
        checked_joints(device, joints)
    except DomainError as error:
        return error
    return DomainError(
        f"the {device.name} is outside of its functional configuration space: joints {joints}",
        why=f"its margin to joint limits and singularities is {device.margin(joints):.3g}",
    )


def _channels_of(loop: Loop, scene: Scene) -> dict[str, Array]:
    """Return what the recording holds of a run: the channels of any loop, of its effects, and of joints that turn."""
    names = ["hip", "ihip", "force", "velocity", "operator_force"]
    added_by_effects = {name for effect in scene.effects for name in effect.channels}
    names += [name for name in ("measured_hip", "measured_velocity", "measured_force") if name in added_by_effects]
    if scene.robot.turning:
        names += ["joint_position", "joint_velocity", "joint_torque"]
    return {name: getattr(loop.out, name) for name in names}
