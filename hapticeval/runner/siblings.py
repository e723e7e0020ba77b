"""The runs of one renderer in one scene: the one that is judged, and the siblings that checks ask for."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import cast

import numpy as np

from hapticeval.closed_forms import form_of
from hapticeval.devices.point_mass import PointMass
from hapticeval.effects.effect import Stage
from hapticeval.errors import RefusalError
from hapticeval.geometry.model import Model
from hapticeval.geometry.motion import Motion, scaling
from hapticeval.phenomena.check import Runs
from hapticeval.phenomena.observed import Observed
from hapticeval.recordings.recording import Recording, runs_of
from hapticeval.renderer import RendererFactory, WrappedRenderer
from hapticeval.scene import Scene
from hapticeval.simulation.answers import make_renderer
from hapticeval.simulation.checked_calls import ask_without_hip, timed_steps
from hapticeval.simulation.closed_loop import simulate_closed_loop
from hapticeval.simulation.playback import Closeup, hold_law_to_step, play, play_in_turns, play_while_defined
from hapticeval.stimulus.motions import unjudged_rows
from hapticeval.stimulus.stimulus import Experiment, Path, Stimulus
from hapticeval.suite.case import Case
from hapticeval.types import Array

FEWEST_TIMED_STEPS = 100
"""Steps whose median says how long one takes: what is compiled on first use slows the first of them alone."""


class SiblingRuns:
    """Makes recordings of one renderer in one scene, and counts the seconds that it simulates.

    `runs` records the `base` first. Siblings are made after it, and follow its `stimulus`, or so much of that as the
    base has answered.
    """

    base: Recording

    def __init__(self, factory: RendererFactory, scene: Scene, case: Case, name: str) -> None:
        self.factory, self.scene = factory, scene
        # By motion: checks ask for several nudges of one, and preparing a renderer may take seconds.
        self._moved: dict[Motion, tuple[Scene, WrappedRenderer | None]] = {}
        self.simulated = 0.0
        self.step_seconds: float | None = None
        self.renderer = make_renderer(factory, scene)
        self.stimulus = case.build_stimulus(scene, self.renderer)
        self.closed_form = case.closed_form.get(name) or _declared_form(self.renderer, scene)

    def record(self, stimulus: Stimulus, dt: float, *, lead: Callable[..., Recording] = play) -> Recording:
        """Record what the renderer answers in steps of `dt` (s): along a path by `lead`, to an experiment in a loop."""
        return self._record(self.renderer, self.scene, stimulus, dt, lead=lead)

    def _record(
        self,
        renderer: WrappedRenderer,
        scene: Scene,
        stimulus: Stimulus,
        dt: float,
        *,
        lead: Callable[..., Recording] = play,
    ) -> Recording:
        """Record as `record` does, with any renderer in any scene."""
        if isinstance(stimulus, Path):
            recording = lead(renderer, stimulus, dt, scene=scene)
        else:
            recording = simulate_closed_loop(renderer, stimulus, scene, dt)
        self.simulated += len(recording) * dt
        return recording

    def runs(self) -> Runs:
        """Return the base recording, with its siblings, further recordings that a check may ask for, made on demand.

        Raises `RendererError` where the renderer's compiled step answers other than its `step`.
        """
        with timed_steps() as seconds:
            self.base = base = self.record(self.stimulus, self.scene.sampling_time, lead=play_while_defined)
        if len(seconds) >= FEWEST_TIMED_STEPS:
            self.step_seconds = float(np.median(seconds))
        hold_law_to_step(self.renderer, base, contact=Observed(base, self.scene).contact)
        if isinstance(self.stimulus, Experiment):
            return self._runs_of_loop().remembered()
        # The law has left its domain: siblings follow only the HIPs that it has answered.
        if "ended" in base.meta:
            self.stimulus = Path(base.time, base.hip)
        return self._runs_of_path().remembered()

    def _runs_of_loop(self) -> Runs:
        """Return a closed loop with its siblings. It cannot be led backwards: its forces decide where the hand goes."""
        return Runs(
            self.base,
            refine=self.refine,
            again=self.again,
            fresh=self.fresh,
            moved=self.moved,
            pieces=self.renderer.pieces,
            at_speed=self.at_speed,
            closed_form=self.closed_form,
            # along the recorded HIPs, where these ask the renderer the same again
            without=self.without if answers_the_hip(self.scene) else None,
        )

    def _runs_of_path(self) -> Runs:
        """Return a path with its siblings; some are of one that is answered in ticks alone."""
        in_ticks = self.renderer.steps
        return Runs(
            self.base,
            refine=self.refine,
            again=self.again,
            fresh=self.fresh,
            moved=self.moved,
            pieces=self.renderer.pieces,
            reverse=self.reverse,
            without=self.without,
            reordered=self.reordered,
            cut=self.cut,
            in_turns=self.in_turns,
            look=Closeup.of(self.renderer, self.base, self.scene) if in_ticks else None,
            subdivided=self.subdivided if in_ticks else None,
            led_on=self.led_on if in_ticks else None,
            dropped_out=self.dropped_out if in_ticks else None,
        )

    def judged_parts(self, runs: Runs) -> tuple[Runs, ...]:
        """Return the runs that are judged: these, or of a body that jumps those of each stretch between two jumps.

        A jump is no contact, and nothing is asked of the answers in the three ticks after it. A stretch has the
        siblings that are made along the whole path, and jump with it; none that lead the hand otherwise.
        """
        base, motion = runs.base, self.scene.motion
        if motion is None or not motion.jumps:
            return (runs,)
        ahead = base.meta.get("lead_in_ticks", 0) * self.scene.sampling_time
        stretches = [rows for rows in runs_of(~unjudged_rows(motion, base.time + ahead)) if rows[1] - rows[0] > 1]

        def part(first: int, end: int) -> Runs:
            refine, again, fresh, without = runs.refine, runs.again, runs.fresh, runs.without
            assert refine is not None
            assert again is not None
            assert fresh is not None
            return Runs(
                base.part(slice(first, end)),
                # row k of the base is row k * factor of the refined run
                refine=lambda factor: refine(factor).part(slice(factor * first, factor * (end - 1) + 1)),
                again=lambda: again().part(slice(first, end)),
                fresh=lambda number: fresh(number).part(slice(first, end)),
                without=None if without is None else lambda kind: without(kind).part(slice(first, end)),
                pieces=runs.pieces,
            ).remembered()

        return tuple(part(*rows) for rows in stretches)

    def refine(self, factor: int) -> Recording:
        """Record the stimulus at a higher sampling rate; see `Runs.refine`."""
        return self.record(self.stimulus, self.scene.sampling_time / factor)

    def again(self) -> Recording:
        """Record the stimulus once more; see `Runs.again`."""
        return self.record(self.stimulus, self.scene.sampling_time)

    def fresh(self, _number: int) -> Recording:
        """Record the stimulus with a renderer that is made for it; see `Runs.fresh`."""
        renderer = make_renderer(self.factory, self.scene)
        return self._record(renderer, self.scene, self.stimulus, self.scene.sampling_time)

    def reverse(self) -> Recording:
        """Record the path backwards; see `Runs.reverse`."""
        times, hips = cast("Path", self.stimulus).sampled(self.scene.sampling_time)
        # The very same HIPs at even times: times counted from the end would differ in their last digit.
        return self.record(Path(times, hips[::-1]), self.scene.sampling_time)

    def at_speed(self, factor: float) -> Recording:
        """Record the experiment with another speed at its start; see `Runs.at_speed`."""
        return self.record(cast("Experiment", self.stimulus).at_speed(factor), self.scene.sampling_time)

    def moved(self, motion: Motion, nudge: tuple[float, ...]) -> Recording | None:
        """Record the stimulus, shifted by `nudge`, in the moved scene; see `Runs.moved`."""
        if isinstance(self.stimulus, Experiment) and not _moves_alike(self.scene, motion):
            return None
        if motion not in self._moved:
            as_it_is = self.scene, self.renderer
            self._moved[motion] = as_it_is if motion.is_identity else self._with_model(self.scene.model.moved(motion))
        scene, renderer = self._moved[motion]
        if renderer is None:
            return None
        recording = self._played(renderer, scene, self._moved_stimulus(motion, np.array(nudge)))
        if recording is None:
            return None
        # Back into the axes and lengths of the unmoved scene. Of equal stiffness, a force grows with the lengths.
        unmoved = {"hip": motion.back(recording.hip), "ihip": motion.back(recording.ihip)}
        force = motion.turned_back(recording.force) / motion.scale
        lengths = {name: recording.meta[name] / motion.scale for name in ("resolution", "standoff")}
        reported = {name: recording.channels[name] for name in recording.channels.keys() & {"contact"}}
        return Recording(recording.time, {**unmoved, "force": force, **reported}, meta={**recording.meta, **lengths})

    def reordered(self) -> Recording | None:
        """Record the path on the model with its vertices in another order; see `Runs.reordered`."""
        scene, renderer = self._with_model(self.scene.model.reordered())
        return None if renderer is None else self._played(renderer, scene, self.path())

    def cut(self) -> Recording | None:
        """Record the path on the mesh with its faces cut into other triangles; see `Runs.cut`."""
        scene, renderer = self._with_model(self.scene.model.cut())
        return None if renderer is None else self._played(renderer, scene, self.path())

    def dropped_out(self, tick: int) -> tuple[Array | None, Array | None]:
        """Ask for a tick without a HIP, and for the one after it; see `Runs.dropped_out`."""
        dt, hips = self.scene.sampling_time, self.path().points
        self.record(Path(dt * np.arange(tick, dtype=np.float64), hips[:tick]), dt)
        return ask_without_hip(self.renderer, hips[tick], dt)

    def subdivided(self) -> Recording:
        """Record the path with another HIP half way between each two, at half the time step; see `Runs.subdivided`."""
        hips = self.path().points
        # In ticks 0, 1/2, 1, ... n - 1: the n HIPs and the n - 1 midpoints between them.
        half_ticks = 0.5 * np.arange(2.0 * len(hips) - 1.0)
        denser_hips = np.repeat(hips, 2, axis=0)[:-1]
        denser_hips[1::2] = 0.5 * (hips[:-1] + hips[1:])
        return self.record(Path(self.scene.sampling_time * half_ticks, denser_hips), 0.5 * self.scene.sampling_time)

    def led_on(self, laps: int, first: int, period: int) -> Runs:
        """Record the path with one of its laps `laps` times; see `Runs.led_on`."""
        hips, dt = self.path().points, self.scene.sampling_time
        lap = hips[first + 1 : first + period + 1]
        longer = np.concatenate([hips[: first + 1], np.tile(lap, (laps, 1))])
        path = Path(dt * np.arange(len(longer), dtype=np.float64), longer)
        return Runs(self.record(path, dt), refine=lambda factor: self.record(path, dt / factor)).remembered()

    def in_turns(self) -> Recording:
        """Record the path by turns with another renderer; see `Runs.in_turns`."""
        dt = self.scene.sampling_time
        # The other renderer is asked at half size and backwards: what both share, as a global, shows in the answers.
        half_size = scaling(0.5, self.scene.model.dimension)
        path = self.path()
        scene, other = self._with_model(self.scene.model.moved(half_size))
        backward_path = path.reversed()
        # A model that cannot be scaled: another renderer in the same scene.
        if other is None:
            scene, other = self.scene, make_renderer(self.factory, self.scene)
        else:
            backward_path = Path(backward_path.time, half_size(backward_path.points))
        # Tick by tick where both step, else one whole path after the other.
        if self.renderer.steps and other.steps:
            recording = play_in_turns((self.renderer, path, self.scene), (other, backward_path, scene), dt)
        else:
            play(other, backward_path, dt, scene=scene)
            recording = play(self.renderer, path, dt, scene=self.scene)
        self.simulated += 2.0 * len(recording) * dt
        return recording

    def path(self) -> Path:
        """Return the path, sampled at the scene's rate unless the renderer answers a path as a whole."""
        path = cast("Path", self.stimulus)
        return Path(*path.sampled(self.scene.sampling_time)) if self.renderer.steps else path

    def _moved_stimulus(self, motion: Motion, nudge: Array) -> Stimulus:
        """Return the stimulus, shifted by `nudge` (N,), m, and then moved with the scene."""
        if isinstance(self.stimulus, Experiment):
            return self.stimulus.moved(motion, nudge)
        path = self.path()
        return Path(path.time, motion(path.points + nudge))

    def _played(self, renderer: WrappedRenderer, scene: Scene, stimulus: Stimulus) -> Recording | None:
        """Return what a renderer answers to a stimulus; None where it refuses, or ends an experiment early."""
        try:
            recording = self._record(renderer, scene, stimulus, scene.sampling_time)
        except RefusalError:
            return None
        # An experiment that ended early is not comparable with the base recording.
        return None if "ended" in recording.meta else recording

    def _with_model(self, model: Model | None) -> tuple[Scene, WrappedRenderer | None]:
        """Return the scene with another model and a renderer in it, None without a model or where it is refused."""
        if model is None:
            return self.scene, None
        scene = replace(self.scene, model=model)
        try:
            return scene, make_renderer(self.factory, scene)
        except RefusalError:
            return scene, None

    def without(self, kind: str) -> Recording:
        """Record a path with a renderer of its own, made for the scene without an effect; see `Runs.without`."""
        scene = self.scene.without(kind)
        path = self.stimulus if isinstance(self.stimulus, Path) else Path(self.base.time, self.base.hip)
        return self._record(make_renderer(self.factory, scene), scene, path, scene.sampling_time)


def _declared_form(renderer: WrappedRenderer, scene: Scene) -> str | None:
    """Return the name of the closed form that a renderer declares to be, where one of that name fits the scene."""
    promise = renderer.declares
    form = None if promise is None or promise.closed_form is None else form_of(promise.closed_form, scene)
    return None if form is None else form.name


def answers_the_hip(scene: Scene) -> bool:
    """Whether a path of the recorded HIPs asks a renderer the same as the closed loop: exact places and no velocity."""
    return scene.damping == 0.0 and not any(effect.stage is Stage.SENSE for effect in scene.effects)


def _moves_alike(scene: Scene, motion: Motion) -> bool:
    """Whether a closed loop in the moved scene does the same as in the unmoved one, but for the motion.

    It does for a point mass at unchanged size with linear effects. A linked robot is not moved with the scene, effects
    that round or limit do so axis by axis, and at another size forces need not grow with lengths.
    """
    # Effects on what the robot senses, feels or is commanded, or on its joints: not those on the answer alone.
    loop = (effect for effect in scene.effects if effect.stage not in (None, Stage.ANSWER))
    return motion.scale == 1.0 and isinstance(scene.robot, PointMass) and all(effect.linear for effect in loop)
