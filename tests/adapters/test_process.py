"""Renderers in processes of their own: what they answer, and that none keeps anybody waiting."""

from __future__ import annotations

import os
import shlex
import shutil
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from refusals import Refusals

import hapticeval
from hapticeval.adapters import process as adapter
from hapticeval.adapters.process import ProcessRenderer
from hapticeval.discovery import resolve
from hapticeval.errors import DomainError, InputError, RefusalError, RendererError
from hapticeval.geometry.catalogue import make_model
from hapticeval.renderer import Spring, wrapped
from hapticeval.scene import Scene
from hapticeval.simulation.answers import make_renderer
from hapticeval.simulation.playback import play
from hapticeval.stimulus.motions import Spin
from hapticeval.stimulus.stimulus import Path as Way

PROCESS = Path(__file__).parents[2] / "examples" / "process"


LINE = Scene(model=make_model("line"))
CIRCLE = Scene(model=make_model("circle"))
DT = 1e-3

MINE = """
import json, os, sys, time
def say(**answer):
    print(json.dumps(answer), flush=True)
for line in sys.stdin:
    m = json.loads(line)
    call, id = m["call"], m["id"]
    if call == "hello" and not {hello!r}:
        say(id=id, version=1)
    elif call == "scene" and not {scene!r}:
        say(id=id)
    elif call == "reset":
        say(id=id)
    elif call == "bye":
        break
    else:
        exec({{"hello": {hello!r}, "scene": {scene!r}, "step": {step!r}}}[call])
"""


@pytest.fixture
def command(tmp_path: Path) -> Callable[..., str]:
    """Write a process with code put into it; return its name."""

    def written(hello: str = "", scene: str = "", step: str = "pass") -> str:
        file = tmp_path / "mine.py"
        file.write_text(MINE.format(hello=hello, scene=scene, step=step))
        adapter._hello_of.cache_clear()
        return f"cmd:{shlex.join([sys.executable, str(file)])}"

    return written


def make_process_renderer(name: str, scene: Scene = LINE) -> ProcessRenderer:
    renderer = make_renderer(resolve(name), scene).renderer
    assert isinstance(renderer, ProcessRenderer)
    return renderer


@pytest.fixture(params=["mine.py", "mine.m"])
def example(request: pytest.FixtureRequest) -> str:
    """The reference clients."""
    if request.param == "mine.m":
        octave = shutil.which("octave-cli") or shutil.which("octave")
        if octave is None:
            pytest.skip("no Octave")
        return f"cmd:{shlex.join([octave, '-qf', str(PROCESS / 'mine.m')])}"
    return f"cmd:{shlex.join([sys.executable, str(PROCESS / 'mine.py')])}"


def test_the_reference_client_answers_as_the_nearest_point(example: str) -> None:
    renderer = make_process_renderer(example, CIRCLE)
    facets = CIRCLE.model.mesh(max_error=1e-4 * CIRCLE.model.size)
    hips = np.array([[0.11, 0.0], [0.09, 0.01], [0.05, 0.06], [0.0, -0.098], [0.0, -0.12]])
    renderer.reset(hips[0])
    answers = [renderer.step(hip, 0.0 * hip, DT) for hip in hips]
    ihips, forces = (np.array(each) for each in zip(*answers, strict=True))
    frame = facets.boundary.closest_point(hips)
    inside = frame.distance[:, np.newaxis] < 0.0
    np.testing.assert_allclose(ihips, np.where(inside, frame.foot, hips), atol=1e-14)
    np.testing.assert_allclose(forces, 1000.0 * (ihips - hips), atol=1e-11)
    can = wrapped(renderer)
    assert can.declares is not None
    assert (can.declares.spring, can.supports) == (Spring.ERROR, {"plane"})


@pytest.mark.parametrize("name", ["mine.py", "mine.m"])
def test_the_reference_clients_are_short(name: str) -> None:
    assert len((PROCESS / name).read_text().splitlines()) <= 45


def test_it_is_judged_by_its_name(example: str) -> None:
    results = hapticeval.run(example, select="plane-press/force-magnitude")
    assert [verdict.outcome for verdict in results.verdicts] == ["pass"]


def test_a_renderer_ends_its_process(command: Callable[..., str]) -> None:
    renderer = make_process_renderer(command())
    pid = renderer._child._process.pid
    del renderer
    with pytest.raises(ProcessLookupError):
        os.kill(pid, 0)


@pytest.mark.parametrize(
    "step",
    [
        "print('rubbish', flush=True)",
        "say(id=99, ihip=[0, 0], force=[0, 0])",
        "say(id=id)",
        "say(id=id, ihip=[0, 0, 0], force=[0, 0, 0])",
        "say(id=id, ihip='left', force=[0, 0])",
        "say(id=id, error='no idea')",
        "sys.exit(3)",
        "os.kill(os.getpid(), 11)",
        "os.close(1); time.sleep(60)",
        "time.sleep(60)",
        "[print('x' * 1000000, end='', flush=True) for _ in iter(int, 1)]",
        "sys.stderr.write('it is the valve'); sys.exit(1)",
    ],
)
def test_an_answer_that_makes_no_sense_ends_it(
    refused: Refusals, command: Callable[..., str], step: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(adapter, "ANSWER_PATIENCE", 0.3 if "sleep(60)" in step and "close" not in step else 20.0)
    renderer = make_process_renderer(command(step=step))
    renderer.reset(np.zeros(2))
    begun = time.monotonic()
    for _ in range(2):  # and so ever after
        with refused(RendererError) as raised:
            renderer.step(np.zeros(2), np.zeros(2), DT)
    assert time.monotonic() - begun < 10.0
    assert ("valve" in step) == ("its stderr ends: it is the valve" in raised.value.why)


def test_whole_lines_of_a_thousand_bytes_of_stderr_are_shown(command: Callable[..., str]) -> None:
    step = "sys.stderr.write('before\\n' * 100 + 'Error: the valve\\n' + 'x' * 300); sys.exit(1)"
    renderer = make_process_renderer(command(step=step))
    renderer.reset(np.zeros(2))
    with pytest.raises(RendererError) as raised:
        renderer.step(np.zeros(2), np.zeros(2), DT)
    assert "Error: the valve\nxxx" in raised.value.why
    assert raised.value.why.startswith("its stderr ends: before\n")


def test_a_process_is_given_the_pose_of_a_body_that_moves(command: Callable[..., str]) -> None:
    scene = Scene(model=make_model("circle"), motion=Spin(rate=0.25, centre=(1.0, 0.0)))
    name = command(
        hello="say(id=id, version=1, supports=['plane', 'moving'])",
        step="say(id=id, ihip=m['place']['translation'], force=m['place']['rotation'][1])",
    )
    renderer = make_renderer(resolve(name), scene)
    hip = np.array([0.3, 0.0])
    renderer.reset(hip)
    for tick in range(3):
        pose = scene.motion.pose(tick * DT)
        ihip, force = renderer.step(hip, np.zeros(2), DT)
        assert pose.to_world(ihip) == pytest.approx(pose.translation, abs=1e-12)
        assert pose.turned(force) == pytest.approx(pose.rotation[1], abs=1e-12)
    unplaced = make_renderer(resolve(name), Scene(model=make_model("circle")))
    with pytest.raises(RendererError, match="place"):
        unplaced.step(hip, np.zeros(2), DT)


@pytest.mark.parametrize("number", ["float('nan')", "None"])
def test_an_answer_that_is_not_finite_is_handed_on(command: Callable[..., str], number: str) -> None:
    renderer = make_process_renderer(command(step=f"say(id=id, ihip=[{number}, 0], force=[0, 0])"))
    assert np.isnan(renderer.step(np.zeros(2), np.zeros(2), DT).ihip[0])


STRICT = """
def no_json(word):
    sys.exit(word + " is no JSON")
json.loads(line, parse_constant=no_json)
"""
ON_TOP = "top = [*m['hip'][:2], max(m['hip'][2], 0.05)]; depth = top[2] - m['hip'][2]"
SPRING = f"{ON_TOP}; say(id=id, ihip=top, force=[0.0, 0.0, 1000.0 * depth])"


def test_a_number_that_is_missing_is_null_to_a_strict_parser(command: Callable[..., str]) -> None:
    """Null in Python is None, at which a comparison raises: NaN would have ended the process as the line was read."""
    renderer = make_process_renderer(command(step=STRICT + "say(id=id, ihip=m['velocity'], force=m['hip'])"))
    nowhere = np.array([np.nan, 1.0])
    renderer.reset(np.zeros(2))
    ihip, force = renderer.step(nowhere, np.array([np.inf, -np.inf]), DT)
    np.testing.assert_array_equal(force, nowhere)
    assert np.isnan(ihip).all()


def test_after_a_child_that_was_ended_a_reset_starts_another(refused: Refusals, command: Callable[..., str]) -> None:
    name = command(step=STRICT + "sys.exit(3) if None in m['hip'] else say(id=id, ihip=m['hip'], force=[1.0, 2.0])")
    renderer = make_process_renderer(name)
    renderer.reset(np.zeros(2))
    for _ in range(2):
        with refused(RendererError):
            renderer.step(np.full(2, np.nan), np.zeros(2), DT)
    renderer.reset(np.zeros(2))
    np.testing.assert_array_equal(renderer.step(np.ones(2), np.zeros(2), DT).force, [1.0, 2.0])


def test_after_a_child_that_hung_others_have_less_time(
    refused: Refusals, command: Callable[..., str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(adapter, "ANSWER_PATIENCE", 1.0)
    monkeypatch.setattr(adapter, "HUNG_PATIENCE", 0.5)
    factory = resolve(
        command(step="time.sleep(60) if m['hip'][0] > 0 else say(id=id, ihip=m['hip'], force=[1.0, 2.0])")
    )
    less_time = []
    # Two of one factory: a check may have another renderer made, on the model turned.
    for renderer in (make_renderer(factory, LINE), make_renderer(factory, LINE)):
        renderer.reset(np.zeros(2))
        assert renderer.step(np.zeros(2), np.zeros(2), DT).force[0] == 1.0
        with pytest.raises(RendererError) as raised:
            renderer.step(np.ones(2), np.zeros(2), DT)
        less_time.append("it has less time since one hung before" in raised.value.why)
    assert less_time == [False, True]


def test_a_process_that_has_hung_is_waited_for_as_long_as_two_of_its_longest_answers() -> None:
    assert adapter.Patience().seconds == adapter.ANSWER_PATIENCE
    assert adapter.Patience(has_hung=True).seconds == adapter.HUNG_PATIENCE
    assert adapter.Patience(has_hung=True, longest_answer=3.0).seconds == 6.0
    assert adapter.Patience(has_hung=True, longest_answer=15.0).seconds == adapter.ANSWER_PATIENCE


@pytest.mark.parametrize(
    ("missing", "drop_out"),
    [("say(id=id, refuse='no hand')", "pass"), ("sys.exit(3)", "fail"), ("say(id=id, error='no hand')", "fail")],
)
def test_a_child_without_a_hand_has_to_refuse_and_not_to_die(
    command: Callable[..., str], missing: str, drop_out: str
) -> None:
    """What is asked after `drop-out` is answered by another process: none of it is an error."""
    name = command(step=f"{STRICT}\nif None in m['hip']: {missing}\nelse:\n    {SPRING}")
    results = hapticeval.run(name, suites=["field"], select="press-and-leave", workers=0)
    outcomes = {verdict.check: verdict.outcome for verdict in results.verdicts}
    assert outcomes.pop("drop-out") == drop_out
    assert "error" not in outcomes.values()


@pytest.mark.parametrize(
    "hello",
    [
        "say(id=id, version=2)",
        "say(id=id, version=1, supports=['everything'])",
        "say(id=id, version=1, max_error=-1)",
        "sys.exit(1)",
    ],
)
def test_who_cannot_say_hello_is_no_renderer(refused: Refusals, command: Callable[..., str], hello: str) -> None:
    with refused(InputError):
        resolve(command(hello=hello))


def test_a_greeting_before_hello_is_left_out(command: Callable[..., str]) -> None:
    name = command(hello="print('Welcome to the program'); say(id=id, version=1, name='greeter')")
    assert resolve(name).summary == "greeter"  # type: ignore[attr-defined]


def test_it_may_refuse_the_model_and_the_hip(refused: Refusals, command: Callable[..., str]) -> None:
    with refused(RefusalError):
        make_process_renderer(command(scene="say(id=id, refuse='too thin')"))
    with refused(DomainError):
        make_process_renderer(command(step="say(id=id, refuse='too far')")).step(np.zeros(2), np.zeros(2), DT)


def test_what_is_no_command_is_named(refused: Refusals) -> None:
    with refused(InputError):
        resolve("cmd:./there-is-none")
    with refused(InputError):
        resolve("cmd:'open")


def test_a_long_message_to_a_child_that_does_not_read_ends(
    refused: Refusals, command: Callable[..., str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(adapter, "ANSWER_PATIENCE", 0.5)
    child = make_process_renderer(command(scene="say(id=id); time.sleep(60)"))._child
    with refused(RendererError):
        child.ask("step", adapter.ANSWER_PATIENCE, hip=[0.0] * 100_000)


def test_a_process_declares_how_its_stiffness_varies_and_how_coarse_its_force_is(
    refused: Refusals, command: Callable[..., str]
) -> None:
    said = "say(id=id, stiffness_range=[0.4, 3.0], force_resolution=0.05)"
    assert (
        wrapped(make_process_renderer(command(scene=said))).meta.items()
        >= {"stiffness_least": 0.4, "stiffness_largest": 3.0, "force_resolution": 0.05}.items()
    )
    for wrong in (
        "stiffness_range=[0.4]",
        "stiffness_range=[2, 3]",
        "stiffness_range=[0.4, None]",
        "stiffness_range=[1e-6, 2]",
        "stiffness_range='wide'",
        "force_resolution=-1",
    ):
        with refused(RendererError):
            make_process_renderer(command(scene=f"say(id=id, {wrong})"))


def test_what_it_reports_of_its_contact_is_recorded(command: Callable[..., str]) -> None:
    """Of a process that reports it; one that does not gives no such channel."""
    answer = 'say(id=id, ihip=m["hip"], force=[0.0, 0.0], contact=m["hip"][1] < 0.0)'
    path = Way(np.array([0.0, 0.01]), np.array([[0.0, 0.005], [0.0, -0.005]]))
    recording = play(make_renderer(resolve(command(step=answer)), LINE), path, DT)
    np.testing.assert_array_equal(recording.contact, recording.hip[:, 1] < 0.0)
    silent = 'say(id=id, ihip=m["hip"], force=[0.0, 0.0])'
    assert "contact" not in play(make_renderer(resolve(command(step=silent)), LINE), path, DT).channels
