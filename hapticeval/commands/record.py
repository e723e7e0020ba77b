"""`hapticeval record`: a renderer on hardware, or on the simulated robot in its place, recorded."""

from __future__ import annotations

import contextlib
import signal
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from hapticeval.commands.arguments import option
from hapticeval.commands.terminal import Terminal, say
from hapticeval.errors import HapticevalError, InputError, describe_error, origin, printable

if TYPE_CHECKING:
    from hapticeval.hardware.device import HardwareDevice
    from hapticeval.hardware.live import LiveRun
    from hapticeval.hardware.twin import Twin
    from hapticeval.hardware.wiring import Wiring
    from hapticeval.recordings.recorder import Recorder, Summary
    from hapticeval.renderer import WrappedRenderer
    from hapticeval.scene import Scene
    from hapticeval.stimulus.stimulus import Experiment
    from hapticeval.suite.case import Case

TWIN = "twin"
"""The name of the simulated robot that takes the hardware's place."""

DEFAULT_ROBOT = "parallelogram-2dof"
DEFAULT_STIFFNESS = 300.0
"""N/m: below the bound (2.40) of the robot at 1 kHz all over the model."""

RECORDING_SUFFIXES = (".h5", ".hdf5")
"""Endings of a recording's file."""

EXIT_CODES = """\b
Exit codes:
  0  recorded
  1  recorded, but rows were lost, cycles missed, or it ended early, as by Ctrl-C: the message says which
  2  wrong usage or input, or the hardware has gone; what was recorded is kept
  3  the renderer broke, or the watchdog doubts a reading or a command; what was recorded is kept
"""


def record(
    context: typer.Context,
    output: Annotated[Path, typer.Option("-o", "--output", metavar="FILE.h5", help="The recording to write.")],
    hardware: Annotated[
        str,
        typer.Option(
            "--device",
            metavar="NAME",
            help="twin, the simulated robot; udp://HOST:PORT; or package.module:factory of a driver.",
        ),
    ] = TWIN,
    renderer: Annotated[
        str, typer.Option("-r", "--renderer", metavar="NAME", help="As in `run -r`.")
    ] = "minimum-distance",
    robot: Annotated[
        str | None,
        option(
            metavar="NAME",
            help=f"Of the twin: what it simulates, parallelogram-2dof:NAME=VALUE,...; {DEFAULT_ROBOT} if not given.",
        ),
    ] = None,
    wiring: Annotated[
        Path | None,
        option(
            metavar="TOML", help="What readings and commands of any other device mean: a file with a [device] table."
        ),
    ] = None,
    seconds: Annotated[float, typer.Option("--seconds", metavar="S", help="How long.", min=0.01)] = 10.0,
    stiffness: Annotated[float, typer.Option(metavar="N/M", help="K_p of the scene.")] = DEFAULT_STIFFNESS,
    damping: Annotated[float, typer.Option(metavar="NS/M", help="K_d of the scene.")] = 0.0,
    model: Annotated[
        str, typer.Option(metavar="MODEL", help="As in `hapticeval study field`: circle, cassinian:size=0.15, ...")
    ] = "circle",
    experiment: Annotated[
        str | None,
        option(
            metavar="CASE",
            help="A case of the suite `experiments`, in place of --model, --stiffness, --damping and --seconds.",
        ),
    ] = None,
    rate: Annotated[float, typer.Option(metavar="HZ", help="Cycles a second.", min=1.0)] = 1000.0,
    refuse_above: Annotated[
        bool,
        typer.Option("--refuse-above", help="End the run where a command is above a limit, instead of scaling it."),
    ] = False,
    who: Annotated[str, typer.Option(metavar="NAME", help="The operator, for the recording.")] = "",
    real_time: Annotated[
        bool,
        typer.Option(
            "--real-time",
            help="Run the twin by the clock, over a socket, as a robot does: a busy machine misses cycles then.",
        ),
    ] = False,
) -> None:
    """Run a renderer on a robot and record it.

    While it runs, rows go to FILE.journal beside the recording, which survives a crash: `hapticeval convert` reads it.
    Ctrl-C ends the run and keeps it; a second one leaves it in the journal. The twin has the robot's encoders, motors,
    friction and a delay, and a hand that slides on the model. It runs in simulated time, so that the same command gives
    the same recording. Any other device sets the pace itself, and needs a --wiring, which says what its raw numbers
    mean.

    Motors get no more than the wiring's torque_limit and force_limit, and zeros at the end, on Ctrl-C and where a
    reading is doubtful: see docs/robots.md for what is promised.

    \b
    Examples:
      hapticeval record --device twin -o run.h5
      hapticeval record --device twin --real-time --seconds 60 -o run.h5
      hapticeval record --device udp://192.168.0.10:5005 --wiring rig.toml -r constraint -o run.h5
      hapticeval record --experiment circle-pushed-slow -r set-stabilisation -o run.h5
      hapticeval record --device mycard:MyCard --wiring rig.toml --seconds 60 --who Ann -o run.h5
    """
    from hapticeval.hardware.live import warm
    from hapticeval.hardware.twin import demonstration

    journal = _journal_of(output)
    case = None if experiment is None else _experiment_named(experiment, context)
    wired = _wiring_of(hardware, robot, wiring, strong=case is not None)
    scene = _make_scene(wired, wiring, model, stiffness=stiffness, damping=damping, rate=rate)
    protocol = None
    if case is not None:
        scene, protocol = _scene_of_experiment(case, wired, rate)
        seconds = protocol.duration
    chosen_renderer = _renderer_on_hardware(renderer, scene)
    # Compiles what the loop calls: in the loop that would miss cycles.
    warm(wired, chosen_renderer, scene)
    _warn_of_instability(renderer, scene)
    simulated = hardware == TWIN and not real_time
    meta = {
        **_recording_meta(scene, wired, renderer, hardware=hardware, who=who, simulated=simulated),
        **chosen_renderer.meta,
    }
    robot_of = partial(demonstration, wired, scene) if case is None else partial(_pushed_twin, case, wired, 1.0 / rate)
    opener = _hardware_opener(hardware, wired, robot_of, simulated=simulated)
    cycles, phases = max(1, round(seconds * rate)), () if protocol is None else protocol.phases
    session = _Session(wired, scene, chosen_renderer, meta, cycles, simulated, refuse_above, phases)
    live, summary = session.record(opener, journal, output)
    early = f"; ended early: {live.ended}" if live.ended else ""
    lines = [
        f"{live.cycles} cycles in {(live.cycles + live.missed) / rate:.4g} s{early}",
        describe_step_times(live, rate),
    ]
    say("\n".join([*lines, *live.notes]))
    raise typer.Exit(int(bool(summary.lost or live.missed or live.ended)))


def _journal_of(output: Path) -> Path:
    """Return the journal beside the recording. Raises `InputError` for another ending, and where either is there."""
    journal = output.with_suffix(".journal")
    if output.suffix.lower() not in RECORDING_SUFFIXES:
        raise InputError(
            f"-o {output} does not end in {' or '.join(RECORDING_SUFFIXES)}",
            why="a recording is HDF5, whatever its name",
            todo=f"name it {output.with_suffix('.h5')}; hapticeval convert makes .csv, .mat or .npz of it",
        )
    for file in (output, journal):
        if file.exists():
            raise InputError(f"{file} is there already", why="a recording is never written over", todo="name another")
    return journal


def _renderer_on_hardware(name: str, scene: Scene) -> WrappedRenderer:
    """Make the renderer. Raises `InputError` for one that answers a whole stimulus and no single step."""
    from hapticeval.discovery import resolve
    from hapticeval.simulation.answers import make_renderer

    if scene.motion is not None:
        raise InputError(
            "the scene's body moves, and the hand is a real one",
            why="who leads a hand on hardware says where the body is; a motion of a suite knows nothing of that hand",
            todo="leave motion out of the scene",
        )
    renderer = make_renderer(resolve(name), scene)
    if not renderer.steps:
        raise InputError(
            f"'{name}' cannot run on hardware", why="it has physics of its own", todo="choose another with -r"
        )
    return renderer


def _warn_of_instability(name: str, scene: Scene) -> None:
    """Warn of a loop that may be unstable with velocities low-passed as on hardware, where a simulation is not."""
    from hapticeval.discovery import resolve
    from hapticeval.hardware.wiring import VELOCITY_CUTOFF
    from hapticeval.study.limits.search import describe_instability

    warning = describe_instability(resolve(name), scene, cutoff=VELOCITY_CUTOFF)
    if warning:
        typer.echo(printable(f"warning: {warning}"), err=True)


@dataclass(frozen=True)
class _Session:
    """A run that is to be recorded: `cycles` of a `renderer` in a `scene`, on a robot wired so.

    `simulated` says that the robot has no clock, `refusing` that a command above a limit ends the run.
    """

    wiring: Wiring
    scene: Scene
    renderer: WrappedRenderer
    meta: dict[str, Any]
    cycles: int
    simulated: bool
    refusing: bool
    phases: tuple[tuple[float, str], ...] = ()

    def record(
        self, opener: AbstractContextManager[Callable[[], HardwareDevice]], journal: Path, output: Path
    ) -> tuple[LiveRun, Summary]:
        """Run, and make a recording of the journal: also of a run that failed, whose error is raised afterwards."""
        from hapticeval.hardware.device import FIRST_PATIENCE
        from hapticeval.hardware.live import channels, run, signals
        from hapticeval.recordings.recorder import Recorder

        failure: HapticevalError | None = None
        recorder: Recorder | None = None
        widths = channels(self.wiring.device.dimension)
        try:
            with (
                # In this order: the twin's process starts first, so that it holds nothing of the recorder's.
                opener as connect,
                Recorder(journal, widths, signals=signals(self.wiring), meta=self.meta) as recorder,
                Terminal() as terminal,
            ):
                tell = self._progress(recorder, terminal)
                try:
                    live = run(
                        connect,
                        self.wiring,
                        self.renderer,
                        self.scene,
                        recorder,
                        cycles=self.cycles,
                        tell=tell,
                        patience=FIRST_PATIENCE if self.simulated else None,
                        refusing=self.refusing,
                        phases=self.phases,
                    )
                except HapticevalError as error:
                    failure = error
                # Also where the run failed: what was recorded is kept.
                summary = recorder.close()
            _write_recording(journal, output, summary)
        except KeyboardInterrupt:
            signal.signal(signal.SIGINT, signal.SIG_IGN)  # what is left to do is to say so, and to end
            typer.echo(_interrupted_words(journal, output, None if recorder is None else recorder.summary), err=True)
            raise typer.Exit(1) from None
        if failure is not None:
            for note in getattr(failure, "__notes__", ()):
                say(note)
            raise failure
        return live, summary

    def _progress(self, recorder: Recorder, terminal: Terminal) -> Callable[[int], None]:
        """Return what is told how many cycles are done: once a second a line shows it."""
        # Cycles a second.
        rate = 1.0 / self.scene.sampling_time
        reported_cycles = 0

        def tell(done: int) -> None:
            nonlocal reported_cycles
            if self.simulated:
                # No clock holds the loop back: it must not run ahead of the writer.
                recorder.wait_for_room()
            # Once a second: printing takes time from the loop's side.
            if done >= reported_cycles + rate:
                reported_cycles = done
                begun = [name for begin, name in self.phases if begin * rate <= done]
                words = ": ".join([f"{done / rate:.0f} of {self.cycles / rate:g} s", *begun[-1:]])
                terminal.working(min(done, self.cycles) - 1, self.cycles, words)

        return tell


def describe_step_times(live: LiveRun, rate: float) -> str:
    """Return how long a step took, beside the time that there is for it; where that was too long, what to do."""
    # s.
    period = 1.0 / rate
    times = (
        f"a step took {1e3 * live.median:.3g} ms in the median, {1e3 * live.longest:.3g} ms at the longest; "
        f"a cycle comes every {1e3 * period:.3g} ms"
    )
    if not live.missed:
        return times
    # Half of the steps are too long: the rate itself cannot be kept.
    if live.median > period:
        todo = f"a --rate below {rate:g}, or a faster renderer"
    elif live.longest > period:
        todo = f"a --rate below {rate:g}, a faster renderer, or fewer other programs, which hold up single steps"
    else:
        todo = "no step was too long: see what else runs here, and what holds up the way from the robot"
    return f"{times}\n  what to do: {todo}"


def _write_recording(journal: Path, output: Path, summary: Summary) -> None:
    """Make a recording of the journal, which goes when that is done; one without a row goes at once."""
    from hapticeval.recordings.hdf5 import write_recording
    from hapticeval.recordings.journal import recover

    if not summary.rows:
        journal.unlink()
        return
    try:
        write_recording(output, recover(journal))
    except (HapticevalError, OSError) as error:
        raise HapticevalError(
            f"the recording {output} could not be written",
            why=str(error),
            todo=f"the run is in {journal}: hapticeval convert {journal} -o FILE.h5",
        ) from error
    journal.unlink()
    say(f"{summary}\nwrote {output}")


def _interrupted_words(journal: Path, output: Path, summary: Summary | None) -> str:
    """What there is of a run that was interrupted outside of its loop, where nothing more is done for it."""
    if output.exists():
        return f"interrupted: the run is in {output}"
    if summary is None or not summary.rows + summary.waiting:
        # The recorder has begun a journal without a row.
        if summary is not None:
            journal.unlink(missing_ok=True)
        return "interrupted: nothing was recorded"
    return f"interrupted: the run is kept in {journal}: hapticeval convert {journal} -o {output}"


def _experiment_named(name: str, context: typer.Context) -> Case:
    """Return the case of the suite `experiments`. Raises `UnknownNameError`, and `InputError` for what it decides."""
    from hapticeval.suite.reading import load_suite

    for option_name in ("model", "stiffness", "damping", "seconds"):
        source = context.get_parameter_source(option_name)
        if source is not None and source.name == "COMMANDLINE":
            raise InputError(
                f"--experiment and --{option_name} are both given",
                why="an experiment has its own",
                todo="leave one out",
            )
    return load_suite("experiments").case(name)


def _scene_of_experiment(case: Case, wiring: Wiring, rate: float) -> tuple[Scene, Experiment]:
    """Return the scene of an experiment on the robot that is there, which has its own imperfections; the protocol."""
    from dataclasses import replace

    scene, protocol = case.build_scene(), case.experiment
    assert protocol is not None
    on_robot = replace(scene, device=wiring.device, believed=None, effects=(), sampling_time=1.0 / rate)
    return on_robot, protocol.experiment(case.folder)


def _pushed_twin(case: Case, wiring: Wiring, dt: float) -> Twin:
    """Return the simulated robot with the imperfections of a case, under the pushes of its experiment."""
    from hapticeval.hardware.twin import Twin

    assert case.experiment is not None
    protocol = case.experiment.experiment(case.folder)
    effects, push = case.build_scene().effects, protocol.operator_force
    return Twin(wiring, effects, position=protocol.position, hand=protocol.hand, dt=dt, push=push)


def _wiring_of(hardware: str, robot: str | None, file: Path | None, *, strong: bool) -> Wiring:
    """From a file; else, of the twin alone, the named robot with its own encoders, wired straight.

    No other hardware has a wiring that could be taken for granted: radians taken as counts would be a hand that stands
    still, deep in the model, and the force of that would go to the motors. A `strong` twin has the motors that the
    experiments in print need.
    """
    from hapticeval.devices.catalogue import device_named
    from hapticeval.devices.parallelogram import ENCODER_COUNTS, LIKELY_MOTOR_TORQUE
    from hapticeval.hardware.wiring import Wiring, read_wiring

    if file is None:
        device = device_named(robot or DEFAULT_ROBOT)
        if hardware != TWIN:
            raise InputError(
                f"--device {hardware} needs a --wiring",
                why="what its readings and commands mean, only you know: radians taken as encoder counts, or the "
                "reverse, put the hand elsewhere, and the force of that place on the motors",
                todo="write them into a file, and give --wiring FILE; the smallest is\n"
                + _smallest_wiring(robot or DEFAULT_ROBOT, slides=not device.turning),
            )
        # The twin's own encoders; a point mass is read in m.
        motors = (LIKELY_MOTOR_TORQUE,) * device.dimension if strong else ()
        counts = ENCODER_COUNTS if device.turning else None
        return Wiring(device=device, counts_per_turn=counts, torque_limit=motors)
    # The file has a kind of its own.
    if robot is not None:
        raise InputError("--robot and --wiring both say which robot it is", todo="leave --robot out")
    return read_wiring(file)


def _smallest_wiring(robot: str, *, slides: bool) -> str:
    """The least that a wiring says of a robot named so, as the lines of a file."""
    kind, _, entries = robot.partition(":")
    pairs = [part.partition("=") for part in entries.split(",") if part]
    lines = [
        f"[device]                        # {'metres and N' if slides else 'joint angles in rad and torques in N m'}",
        f'kind = "{kind}"',
        *(f"{name.strip()} = {_toml_value(value.strip())}" for name, _, value in pairs),
    ]
    if not slides:
        lines.append("# counts_per_turn = 262144      # where read() gives encoder counts")
    lines.append("# see examples/rig.toml for offsets, directions and the unit of commands, here 0, 1 and 1")
    return "\n".join(f"    {line}" for line in lines)


def _toml_value(value: str) -> str:
    """Return a value as TOML writes it: a number, or else a text in quotes."""
    try:
        return f"{float(value):g}"
    except ValueError:
        return f'"{value}"'


def _make_scene(
    wiring: Wiring, file: Path | None, model: str, *, stiffness: float, damping: float, rate: float
) -> Scene:
    """The scene, on a model that the robot can reach."""
    from hapticeval.commands.arguments import model_named
    from hapticeval.devices.device import require_in_workspace
    from hapticeval.scene import Scene

    touched = model_named(model)
    if touched.dimension != wiring.device.dimension:
        other = "parallelogram-2dof" if touched.dimension == 2 else "parallelogram-3dof"
        how = (
            f"--robot {other}"
            if file is None
            else f'another kind in {file}, where your robot is one, such as "{other}"'
        )
        raise InputError(
            f"--model {model} has {touched.dimension} dimensions, and {wiring.device.name} {wiring.device.dimension}",
            why="a device feels models of its own space only",
            todo=f"give {how}; or choose a model of {wiring.device.dimension} dimensions",
        )
    # Refuses a model that lies outside of the workspace.
    require_in_workspace(wiring.device, touched)
    return Scene(model=touched, stiffness=stiffness, damping=damping, device=wiring.device, sampling_time=1.0 / rate)


@contextlib.contextmanager
def _hardware_opener(
    name: str, wiring: Wiring, twin: Callable[[], Twin], *, simulated: bool
) -> Iterator[Callable[[], HardwareDevice]]:
    """What opens the hardware of that name: what `twin` makes, by itself where `simulated`, else behind a loopback
    socket; a robot behind a socket; or a driver.

    The twin's process starts here, before the recorder's, so that it holds nothing of that.
    """
    if simulated:
        yield twin
        return
    from hapticeval.hardware.udp import UdpDevice, running

    joints = wiring.device.dimension
    if name == TWIN:
        with running(twin()) as address:
            yield lambda: UdpDevice(address, joints)
    elif name.startswith("udp://"):
        # The last colon: an IPv6 address has several.
        host, _, port = name.removeprefix("udp://").rpartition(":")
        if not host or not port.isdigit():
            raise InputError(f"--device {name}", why="an address is udp://HOST:PORT", todo="give host and port")
        yield lambda: UdpDevice((host, int(port)), joints)
    else:
        from hapticeval.discovery import load

        driver_factory = load(name, kind="driver")
        yield lambda: _open_driver(name, driver_factory)


def _open_driver(name: str, factory: Callable[[], Any]) -> HardwareDevice:
    """Make the driver, and see that it has what a device has; what it raises is reported as the driver's fault."""
    from hapticeval.hardware.device import HardwareDevice

    try:
        driver = factory()
    except HapticevalError:
        raise
    except Exception as error:
        raise HapticevalError(
            f"the driver '{name}' could not be opened: {describe_error(error)}", why=origin(error)
        ) from error
    if not isinstance(driver, HardwareDevice):
        raise InputError(
            f"'{name}' made a {type(driver).__name__}, which is not hardware",
            why="a driver has read(), write(command) and close()",
            todo="see examples/my_card.py",
        )
    return driver


def _recording_meta(
    scene: Scene, wiring: Wiring, renderer: str, *, hardware: str, who: str, simulated: bool
) -> dict[str, Any]:
    """Return what the recording says of itself: renderer, scene, device, clock, time and versions."""
    from datetime import UTC, datetime

    from hapticeval.runner.results import environment

    gains = {"stiffness": scene.stiffness, "damping": scene.damping, "mass": scene.mass}
    # Its kind stands in a field of its own.
    device = wiring.description()
    meta = {
        "source": "hardware",
        "renderer": renderer,
        "scene": {
            **gains,
            "sampling_time": scene.sampling_time,
            "bilateral": scene.bilateral,
            "model": scene.model.table,
        },
        "gains": gains,
        "inner_loop": scene.inner_loop.value,
        "device": device.pop("kind"),
        "device_parameters": {"hardware": hardware, **device},
        "dt": scene.sampling_time,
        "clock": "simulated time" if simulated else "monotonic clock of the robot's side",
        "when": datetime.now(UTC).isoformat(timespec="seconds"),
        "software": environment()["versions"],
    }
    return {**meta, "who": who} if who else meta
