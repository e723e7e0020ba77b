"""`hapticeval record`: a renderer on hardware, or on the simulated robot in its place, recorded."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from hapticeval.errors import InputError
from hapticeval.output import say

if TYPE_CHECKING:
    from hapticeval.devices.device import Device
    from hapticeval.hardware.device import HardwareDevice
    from hapticeval.hardware.wiring import Wiring
    from hapticeval.scene import Scene

TWIN = "twin"
MODEL = {"kind": "circle", "size": 0.2}
STIFFNESS = 300.0
"""N/m: below the bound (2.40) of the robot at 1 kHz all over the model."""

EXIT_CODES = """\b
Exit codes:
  0  recorded
  1  recorded, but rows were lost or cycles missed: the message says how many
  2  wrong usage or input, or the hardware has gone
  3  the renderer broke
"""


def record(
    output: Annotated[Path, typer.Option("-o", "--output", metavar="FILE.h5", help="The recording to write.")],
    hardware: Annotated[
        str,
        typer.Option(
            "--device",
            metavar="NAME",
            help="twin, the simulated robot in real time; udp://HOST:PORT; or package.module:factory of a driver.",
        ),
    ] = TWIN,
    renderer: Annotated[
        str, typer.Option("-r", "--renderer", metavar="NAME", help="As in `run -r`.")
    ] = "minimum-distance+pp-pd",
    robot: Annotated[
        str, typer.Option(metavar="NAME", help="The robot's kinematics, as in `hapticeval device`.")
    ] = "parallelogram-2dof",
    seconds: Annotated[float, typer.Option(help="How long.", min=0.01)] = 10.0,
    stiffness: Annotated[float, typer.Option(metavar="N/M", help="K_p of the scene.")] = STIFFNESS,
    damping: Annotated[float, typer.Option(metavar="NS/M", help="K_d of the scene.")] = 1.0,
    model: Annotated[
        str, typer.Option(metavar="MODEL", help="As in `hapticeval field`: circle, cassinian:size=0.15, ...")
    ] = "circle",
    rate: Annotated[float, typer.Option(metavar="HZ", help="Cycles a second.", min=1.0)] = 1000.0,
    who: Annotated[str, typer.Option(metavar="NAME", help="The operator, for the recording.")] = "",
) -> None:
    """Run a renderer on a robot and record it.

    While it runs, rows go to FILE.journal beside the recording, which survives a crash: `hapticeval convert` reads it.
    The twin has the robot's encoders, motors, friction and a delay, and a hand that slides round the model.

    \b
    Examples:
      hapticeval record --device twin -o run.h5
      hapticeval record --device udp://192.168.0.10:5005 -r constraint -o run.h5
      hapticeval record --device mycard:MyCard --seconds 60 --who Ann -o run.h5
    """
    from hapticeval.devices.catalogue import device_named
    from hapticeval.discovery import resolve
    from hapticeval.hardware.session import SIGNALS, channels, run
    from hapticeval.hardware.wiring import Wiring
    from hapticeval.judging import built
    from hapticeval.picturing import model_named
    from hapticeval.recordings.recorder import Recorder
    from hapticeval.recordings.recovery import finish
    from hapticeval.renderer import Renderer
    from hapticeval.scene import Scene
    from hapticeval.terminal import Terminal

    journal = output.with_suffix(".journal")
    for file in (output, journal):
        if file.exists():
            raise InputError(f"{file} is there already", why="a recording is never written over", todo="name another")
    device = device_named(robot)
    scene = Scene(
        model=model_named(model), stiffness=stiffness, damping=damping, device=device, sampling_time=1.0 / rate
    )
    made = built(resolve(renderer), scene)
    if not isinstance(made, Renderer):
        raise InputError(
            f"'{renderer}' cannot run on hardware", why="it has physics of its own", todo="choose another with -r"
        )
    wiring = Wiring(device=device)
    cycles = round(seconds * rate)
    meta = _meta(scene, wiring, renderer, model=_spec(scene), hardware=hardware, who=who)
    with (
        Terminal() as terminal,
        _opened(hardware, wiring, scene) as opened,
        Recorder(journal, channels(device.dimension), signals=SIGNALS, meta=meta) as recorder,
    ):

        def tell(done: int) -> None:
            if done % round(rate) == 0:
                terminal.working(done, cycles, f"{done / rate:.0f} of {seconds:g} s")

        session = run(opened, wiring, made, scene, recorder, cycles=cycles, tell=tell)
        summary = recorder.close()
    finish(journal, output)
    journal.unlink()
    say(f"{session.cycles} cycles in {session.cycles / rate:.4g} s; {summary}\nwrote {output}")
    raise typer.Exit(int(bool(summary.lost or session.missed)))


@contextlib.contextmanager
def _opened(name: str, wiring: Wiring, scene: Scene) -> Iterator[HardwareDevice]:
    """The hardware by its name: the twin behind a loopback socket, a robot behind a socket, or a driver."""
    from hapticeval.hardware.twin import running
    from hapticeval.hardware.udp import UdpDevice

    if name == TWIN:
        with running(_twin(wiring, scene)) as address:
            device = UdpDevice(address, wiring.device.dimension)
            yield device
            device.close()
    elif name.startswith("udp://"):
        host, _, port = name.removeprefix("udp://").rpartition(":")
        if not host or not port.isdigit():
            raise InputError(f"--device {name}", why="an address is udp://HOST:PORT", todo="give host and port")
        yield UdpDevice((host, int(port)), wiring.device.dimension)
    else:
        from hapticeval.discovery import load
        from hapticeval.hardware.device import HardwareDevice

        driver = load(name)()
        if not isinstance(driver, HardwareDevice):
            raise InputError(
                f"'{name}' made a {type(driver).__name__}, which is no hardware",
                why="a driver has read(), write(command) and close()",
                todo="see 'Record your robot' in the README",
            )
        yield driver


def _twin(wiring: Wiring, scene: Scene) -> Any:
    """The robot with all that is imperfect in it, and a hand that slides to and fro round the model, 5 mm inside."""
    import numpy as np

    from hapticeval.devices.criteria import MOTOR_TORQUE
    from hapticeval.devices.imperfections import ENCODER_STEP, Imperfections
    from hapticeval.hardware.twin import Twin
    from hapticeval.stimulus import Hand, Path

    boundary = scene.model.curve
    start = boundary.arc_length(boundary.nearest([[1.0, 0.0]]))[0]
    reach = 0.12 * (boundary.length if boundary.closed else 1.0)
    time = np.linspace(0.0, 600.0, 24_001)
    way = boundary.parameter(start + reach * np.sin(0.4 * np.pi * time))
    path = boundary.position(way) - 0.005 * boundary.normal(way)
    effects = Imperfections(encoder_step=ENCODER_STEP, torque_limit=MOTOR_TORQUE, delay=2e-4, friction=2e-3)
    hand = Hand(path=Path(time, path), stiffness=250.0, damping=4.0)
    return Twin(wiring, effects, position=path[0], hand=hand, dt=scene.sampling_time)


def _spec(scene: Scene) -> dict[str, Any]:
    """The model as a suite names it."""
    parameters = dict(scene.model.parameters)
    return {"kind": scene.model.name, **parameters}


def _meta(
    scene: Scene, wiring: Wiring, renderer: str, *, model: dict[str, Any], hardware: str, who: str
) -> dict[str, Any]:
    from datetime import UTC, datetime

    from hapticeval.results import environment

    gains = {"stiffness": scene.stiffness, "damping": scene.damping, "mass": scene.mass}
    told = {
        "source": "hardware",
        "renderer": renderer,
        "scene": {**gains, "sampling_time": scene.sampling_time, "bilateral": scene.bilateral, "model": model},
        "gains": gains,
        "device": wiring.device.name,
        "device_parameters": {
            "hardware": hardware,
            "counts_per_turn": wiring.counts_per_turn,
            "offsets": list(wiring.offsets),
            "directions": list(wiring.directions),
            **_constants(wiring.device),
        },
        "dt": scene.sampling_time,
        "clock": "monotonic clock of the robot's side",
        "when": datetime.now(UTC).isoformat(timespec="seconds"),
        "software": environment()["versions"],
    }
    return {**told, "who": who} if who else told


def _constants(device: Device) -> dict[str, float]:
    from dataclasses import asdict

    constants = getattr(device, "constants", None)
    return {} if constants is None else asdict(constants)
