"""Renderers in shared libraries: built here, called alike by every way, and what is said of those that are none."""

from __future__ import annotations

import subprocess
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from refusals import Refusals

import hapticeval
from hapticeval.adapters import library as adapter
from hapticeval.adapters.library import HEADER, LibraryRenderer
from hapticeval.discovery import Name, parse, resolve, resolve_installed
from hapticeval.errors import DomainError, InputError, RefusalError, RendererError
from hapticeval.geometry.catalogue import make_model
from hapticeval.recordings.recording import backward_difference
from hapticeval.renderer import Declaration, Spring, wrapped
from hapticeval.scene import Scene
from hapticeval.simulation.answers import make_renderer
from hapticeval.simulation.closed_loop import simulate_closed_loop
from hapticeval.simulation.playback import answers_along, play
from hapticeval.stimulus.motions import Slide, Spin
from hapticeval.stimulus.stimulus import Experiment
from hapticeval.stimulus.stimulus import Path as HandPath
from hapticeval.study.bench.measure import Track, step_times
from hapticeval.types import Array

Build = Callable[..., Path]

LINE = Scene(model=make_model("line"), mass=1.0)
DT = 1e-3


def make_library_renderer(file: Path, scene: Scene = LINE) -> LibraryRenderer:
    renderer = make_renderer(resolve(f"lib:{file}"), scene).renderer
    assert isinstance(renderer, LibraryRenderer)
    return renderer


def pushed(duration: float) -> Experiment:
    """A hand that pushes a tool down on the line, from 1 mm above."""
    start = np.array([0.0, 0.001])
    return Experiment(duration, start, np.zeros(2), np.array([0.0]), np.array([[0.1, -2.0]]))


def slide(dimension: int) -> Array:
    """A way in, along and out of a model of 0.2 m about the origin."""
    time = np.linspace(0.0, 1.0, 300)[:, np.newaxis]
    angle = 2.0 * time
    radius = 0.12 - 0.03 * np.sin(np.pi * time)
    third = np.zeros((300, dimension - 2)) + 0.01 * time
    return np.hstack([radius * np.cos(angle), radius * np.sin(angle), third])


@pytest.mark.parametrize(("kind", "example"), [("circle", "penalty"), ("cube", "penalty"), ("cube", "god_object")])
def test_step_and_the_compiled_step_give_the_same_bits(kind: str, example: str, request: pytest.FixtureRequest) -> None:
    scene = Scene(model=make_model(kind, size=0.2), damping=3.0)
    renderer = make_library_renderer(request.getfixturevalue(example), scene)
    hips = slide(scene.model.dimension)
    velocities = backward_difference(hips, DT * np.arange(len(hips)))
    renderer.reset(hips[0])
    steps = [renderer.step(hip, velocity, DT) for hip, velocity in zip(hips, velocities, strict=True)]
    assert wrapped(renderer).law is not None
    answers = answers_along(renderer, hips, DT)
    for part in range(2):
        np.testing.assert_array_equal(answers[part], np.array([step[part] for step in steps]))
    touched = np.any(answers.force != 0.0, axis=1)
    assert touched.any()
    np.testing.assert_array_equal(answers.contact, touched)


def test_a_closed_loop_is_the_same_with_and_without_the_compiled_step(build: Build) -> None:
    renderer = make_library_renderer(build())
    push = pushed(0.2)
    loop = simulate_closed_loop(renderer, push, LINE, DT)

    class Plain:
        reset, step = renderer.reset, renderer.step

    plain = simulate_closed_loop(Plain(), push, LINE, DT)
    np.testing.assert_allclose(loop.hip, plain.hip, atol=1e-12)
    assert loop.contact.any()
    np.testing.assert_array_equal(loop.channels["contact"] != 0.0, np.any(loop.force != 0.0, axis=1))
    assert "contact" not in plain.channels


def test_what_a_scene_is_reaches_the_library(build: Build) -> None:
    told = (
        "if (scene->size != sizeof *scene || scene->mass != 1.0 || scene->stiffness != 1000.0 || scene->flags != 4"
        " || scene->sampling_time != 1e-3 || scene->n_vertices != scene->n_cells || scene->cells[1] != 1) return -7"
    )
    scene = Scene(model=make_model("circle"), mass=1.0, bilateral=True)
    renderer = make_library_renderer(build(CREATE=told, FLAGS="(HR_PLANE | HR_BILATERAL | HR_SPRING)"), scene)
    facets = scene.model.mesh(max_error=1e-4 * scene.model.size)
    assert renderer.standoff == facets.chord_error  # type: ignore[attr-defined]
    assert renderer.surface is facets.boundary  # type: ignore[attr-defined]
    declared = wrapped(renderer).declares
    assert declared is not None
    assert declared.spring is Spring.ERROR


def test_lengths_are_asked_for_with_the_scene_and_add_to_the_chord_error(build: Build) -> None:
    info = "if (self) { info->standoff = 1e-4; info->resolution = 2e-3; } else info->max_error = 5e-5"
    assert make_library_renderer(build(INFO=info)).standoff == 1e-4  # type: ignore[attr-defined]
    renderer = make_library_renderer(build(INFO=info), Scene(model=make_model("circle")))
    assert 1e-4 < renderer.standoff <= 1.5e-4  # type: ignore[attr-defined]
    assert renderer.resolution >= 2e-3  # type: ignore[attr-defined]


def test_a_reset_gives_the_tool_a_free_point(build: Build) -> None:
    near = "tool[1] > 1e-4 && tool[1] < 1e-3 && fabs(tool[0] - hip[0]) < 1e-9"
    check = f"if (hip[1] < 1e-4 ? !({near}) : tool[0] != hip[0] || tool[1] != hip[1]) return -3"
    renderer = make_library_renderer(build(RESET=check, INFO="if (self) info->standoff = 1e-4"))
    for height in (-0.02, 0.0, 1e-6, 0.02):
        renderer.reset(np.array([0.01, height]))


def test_what_it_does_not_write_is_not_finite(refused: Refusals, build: Build) -> None:
    path = HandPath(np.array([0.0, 0.01]), np.array([[0.0, 0.001], [0.0, -0.001]]))
    with refused(RendererError):
        play(make_library_renderer(build(STEP="if (hip[1] < 0) return HR_CONTACT")), path, DT, scene=LINE)


@pytest.mark.parametrize("returned", [-3, 7])
def test_a_step_that_broke_names_tick_and_number(refused: Refusals, build: Build, returned: int) -> None:
    library = build(STEP=f"if (m->ticks > 5) return {returned}")
    path = HandPath(np.array([0.0, 0.01]), np.array([[0.0, 0.001], [0.0, -0.001]]))
    with refused(RendererError):
        play(Stepping(make_library_renderer(library)), path, DT, scene=LINE)
    push = pushed(0.1)
    with refused(RendererError):
        simulate_closed_loop(make_library_renderer(library), push, LINE, DT)


class Stepping:
    def __init__(self, renderer: LibraryRenderer) -> None:
        self.reset, self.step = renderer.reset, renderer.step


def test_a_step_that_refuses_ends_a_loop_and_leaves_what_was(refused: Refusals, build: Build) -> None:
    renderer = make_library_renderer(build(STEP="if (hip[1] < -0.0005) return HR_REFUSES_HIP"))
    push = pushed(0.5)
    recording = simulate_closed_loop(renderer, push, LINE, DT)
    assert "refuses the HIP" in recording.meta["ended"]["what"]
    with refused(DomainError):
        renderer.step(np.array([0.0, -0.001]), np.zeros(2), DT)


def test_a_library_is_destroyed_with_its_renderer(build: Build, tmp_path: Path) -> None:
    file = tmp_path / "destroyed"
    renderer = make_library_renderer(build(DESTROY=f'fclose(fopen("{file}", "w"))'))
    assert not file.exists()
    del renderer
    assert file.exists()


def test_a_step_is_timed_in_a_compiled_loop_and_one_that_breaks_is_named(refused: Refusals, build: Build) -> None:
    renderer = make_library_renderer(build())
    hips = np.column_stack([np.zeros(300), np.linspace(0.002, -0.002, 300)])
    renderer.reset(hips[0])
    nanoseconds = renderer.time_steps(hips, np.zeros_like(hips), DT)  # type: ignore[attr-defined]
    assert nanoseconds.shape == (300,)
    assert nanoseconds.min() >= 0
    assert nanoseconds.max() > 0
    broken = make_library_renderer(build(STEP="if (m->ticks > 5) return -7"))
    with refused(RendererError):
        broken.time_steps(hips, np.zeros_like(hips), DT)  # type: ignore[attr-defined]
    # Called from Python a step takes as long as Python does; in a loop it takes the library's own time.
    along = Track(hips, list(zip(hips, np.zeros_like(hips), strict=True)), DT)
    assert np.median(step_times(renderer, along, 50, first=0)) < 0.5 * np.median(steps_from_python(renderer, hips))


def steps_from_python(renderer: object, hips: np.ndarray) -> list[int]:
    took = []
    for hip in hips:
        begun = time.perf_counter_ns()
        renderer.step(hip, 0.0 * hip, DT)  # type: ignore[attr-defined]
        took.append(time.perf_counter_ns() - begun)
    return took


def test_a_library_declares_how_its_stiffness_varies_and_how_coarse_its_force_is(build: Build) -> None:
    info = "if (self) { info->stiffness_least = 0.4; info->stiffness_largest = 3; info->force_resolution = .05; }"
    declared = wrapped(make_library_renderer(build(INFO=info))).declares
    assert declared == Declaration(stiffness_range=(0.4, 3.0), force_resolution=0.05)
    assert wrapped(make_library_renderer(build())).declares is None


@pytest.mark.parametrize(
    ("code", "error"),
    [
        ({"KEEP": ""}, InputError),
        ({"ABI": "9"}, InputError),
        ({"FLAGS": "1024"}, InputError),
        ({"INFO": "if (!self) return -2"}, InputError),
        ({"INFO": "if (!self) abort()"}, InputError),
        ({"INFO": "if (!self) info->max_error = -1"}, InputError),
        ({"INFO": "if (self) info->standoff = NAN"}, RendererError),
        ({"INFO": "if (self) info->stiffness_least = 0.4"}, RendererError),
        ({"INFO": "if (self) info->force_resolution = -1"}, RendererError),
        ({"CREATE": 'snprintf(why, n, "no %s today", "lines"); return 1'}, RefusalError),
        ({"CREATE": "return -5"}, RendererError),
        ({"FLAGS": "HR_SPACE"}, RefusalError),
    ],
)
def test_what_is_wrong_with_a_library_is_named(
    refused: Refusals, build: Build, code: dict[str, str], error: type
) -> None:
    with refused(error):
        make_library_renderer(build(**code))


def test_a_refusal_has_the_library_s_reason(refused: Refusals, build: Build) -> None:
    with refused(RefusalError):
        make_library_renderer(build(CREATE='snprintf(why, n, "no %s today", "lines"); return 1'))


def test_what_is_no_library_is_named(refused: Refusals, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with refused(InputError):
        resolve(f"lib:{tmp_path}/none.so")
    (tmp_path / "text.so").write_text("not a library")
    with refused(InputError):
        resolve(f"lib:{tmp_path}/text.so")
    with refused(InputError):
        resolve("lib:")


def test_a_missing_name_of_c_plus_plus_is_spelt_out(refused: Refusals, build: Build) -> None:
    with refused(InputError):
        resolve(f"lib:{build(STEP='extern int _ZN4chai6updateEd(void); return _ZN4chai6updateEd()')}")


def test_one_that_hangs_when_it_is_loaded_is_ended(
    refused: Refusals, build: Build, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(adapter, "LOADING_PATIENCE", 0.5)
    with refused(InputError):
        resolve(f"lib:{build(INFO='for (;;) {}')}")


@pytest.mark.system
@pytest.mark.parametrize(
    ("step", "words"), [("abort()", "SIGABRT"), ("*(volatile int *)0 = 1", "SIGSEGV"), ("for (;;) {}", "after 2 s")]
)
def test_a_crash_and_a_hang_cost_their_case(build: Build, step: str, words: str, tmp_path: Path) -> None:
    suite = tmp_path / "two.toml"
    case = '[[case]]\nname = "{}"\ntitle = "{}"\nmodel = {{ kind = "line" }}\nchecks = ["continuous-contact"]\n'
    way = 'trajectory = {{ kind = "points", points = [[0.0, 0.001], [0.0, {}]], duration = 0.02 }}\n'
    suite.write_text(
        'title = "two"\n' + (case + way).format("deep", "deep", -0.001) + (case + way).format("off", "off", 0.002)
    )
    library = build(STEP=f"if (hip[1] < 0) {step}")
    results = hapticeval.run(f"lib:{library}", suites=str(suite), workers=1, timeout=2.0)
    assert [verdict.outcome for verdict in results.verdicts] == ["error", "not-applicable"]
    (error,) = [run.error for run in results.document.runs if run.error]
    assert words in error.what
    # A compiled loop notes what it asks; the hand goes 0.1 mm a tick.
    assert "for (;;)" in step or "at tick 11 (counted from 0), HIP (0, -0.1) mm" in error.what
    assert results.exit_code == 3


def test_a_crash_in_a_closed_loop_names_tick_and_hip(build: Build, tmp_path: Path) -> None:
    case = """
title = "one"
[[case]]
name = "pressed"
title = "Pressed"
model = { kind = "line" }
checks = ["contact-kept"]
experiment = { duration = 0.1, position = [0.0, 0.001], velocity = [0.0, -0.1] }
"""
    (tmp_path / "one.toml").write_text(case)
    results = hapticeval.run(
        f"lib:{build(STEP='if (m->ticks == 8) abort()')}", suites=str(tmp_path / "one.toml"), workers=1
    )
    (error,) = [run.error for run in results.document.runs if run.error]
    assert "tick 7" in error.what + error.why


@pytest.mark.parametrize("name", ["lib:./libmine.so", "cmd:python3 mine.py"])
def test_a_file_may_not_name_one(refused: Refusals, name: str, tmp_path: Path) -> None:
    with refused(InputError):
        resolve_installed(name, source="mysuite.toml")
    suite = tmp_path / "mine.toml"
    case = '[[case]]\nname = "a"\ntitle = "a"\nmodel = { kind = "line" }\nchecks = ["continuous-contact"]\n'
    way = 'trajectory = { kind = "points", points = [[0.0, 0.1], [0.0, 0.2]], duration = 1 }\n'
    suite.write_text(f'title = "a"\nrenderers = ["{name}"]\n' + case + way)
    with refused(InputError):
        hapticeval.run(suites=str(suite))


PLACED = """
static double pose[6];
int32_t hr_place(void *self, const double *given) { (void)self; memcpy(pose, given, sizeof pose); return PLACES; }
"""


@pytest.fixture
def placed(compiler: str, tmp_path: Path) -> Callable[[int], Path]:
    """Build examples/c/penalty.c with a pose: it takes the hand into the body's frame, and its answer back."""

    def built(status: int = 0) -> Path:
        source = (Path(hapticeval.__file__).parents[1] / "examples" / "c" / "penalty.c").read_text()
        source = source.replace("HR_PLANE | HR_SPACE | HR_SPRING", "HR_PLANE | HR_SPRING | HR_MOVING")
        source = source.replace("int32_t hr_step(", "static int32_t step(").replace(
            "void hr_destroy",
            PLACED.replace("PLACES", str(status))
            + """
int32_t hr_step(void *self, const double *hip, const double *velocity, double dt, double *ihip, double *force) {
  double at[2], foot[2], push[2];
  for (int i = 0; i < 2; i++) at[i] = pose[i] * (hip[0] - pose[4]) + pose[2 + i] * (hip[1] - pose[5]);
  int32_t answer = step(self, at, velocity, dt, foot, push);
  for (int i = 0; i < 2; i++) {
    ihip[i] = pose[2 * i] * foot[0] + pose[2 * i + 1] * foot[1] + pose[4 + i];
    force[i] = pose[2 * i] * push[0] + pose[2 * i + 1] * push[1];
  }
  return answer;
}
void hr_destroy""",
        )
        (tmp_path / f"placed{status}.c").write_text(source)
        file = tmp_path / f"libplaced{status}.so"
        command = [compiler, "-shared", "-fPIC", f"-I{HEADER.parent}", "-o", str(file), f"placed{status}.c", "-lm"]
        subprocess.run(command, cwd=tmp_path, check=True)
        return file

    return built


MOVING = Scene(model=make_model("circle"), motion=Spin(rate=1.0, centre=(0.05, 0.02)))
ACROSS = HandPath(np.array([0.0, 0.2]), np.array([[0.11, 0.0], [0.09, 0.02]]))


def test_a_library_that_is_placed_answers_on_a_moving_body_as_at_rest(placed: Callable[..., Path]) -> None:
    factory, resting = resolve(f"lib:{placed()}"), replace(MOVING, motion=Slide(velocity=(0.0, 0.0)))
    moving, still = (play(make_renderer(factory, scene), ACROSS, DT, scene=scene) for scene in (MOVING, resting))
    assert np.any(still.force)
    assert moving.ihip == pytest.approx(still.ihip, abs=1e-9)
    assert moving.force == pytest.approx(still.force, abs=1e-6)
    nearest = play(make_renderer(resolve("minimum-distance"), replace(MOVING, motion=None)), ACROSS, DT)
    assert still.force == pytest.approx(nearest.force, abs=1e3 * 1.5e-4)  # of facets within 1e-4 of the size


def test_a_library_that_breaks_where_it_is_placed_is_blamed(placed: Callable[..., Path], refused: Refusals) -> None:
    with refused(RendererError):
        play(make_renderer(resolve(f"lib:{placed(-3)}"), MOVING), ACROSS, DT, scene=MOVING)


def test_a_library_that_knows_of_no_pose_is_refused(build: Callable[..., Path], refused: Refusals) -> None:
    with refused(RefusalError):
        make_renderer(resolve(f"lib:{build()}"), MOVING)
    with refused(RendererError):
        make_renderer(resolve(f"lib:{build(FLAGS='(HR_PLANE | HR_MOVING)')}"), MOVING)


@pytest.mark.parametrize("name", ["lib:./a+b@c.so", "cmd:mine --to a@b +x"])
def test_paths_and_commands_are_taken_as_they_are(name: str) -> None:
    assert parse(name) == Name(name, None, None)


def test_the_header_is_printed_and_is_c99(compiler: str, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    from hapticeval.cli import main

    assert main(["header"]) == 0
    (tmp_path / "hapticeval.h").write_text(capsys.readouterr().out)
    (tmp_path / "a.c").write_text('#include "hapticeval.h"\n')
    flags = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-fsyntax-only"]
    subprocess.run([compiler, *flags, "a.c"], cwd=tmp_path, check=True)
    assert len((tmp_path / "hapticeval.h").read_text().splitlines()) <= 50


def test_the_structs_are_those_of_the_header(compiler: str, tmp_path: Path) -> None:
    from hapticeval.adapters.library import InfoStruct, SceneStruct

    fields = [("hr_scene", SceneStruct), ("hr_info", InfoStruct)]
    lines = [f'printf("%zu ", offsetof({name}, {field}));' for name, struct in fields for field, *_ in struct._fields_]
    source = '#include <stddef.h>\n#include <stdio.h>\n#include "hapticeval.h"\nint main(void) {' + "".join(lines)
    (tmp_path / "a.c").write_text(source + 'printf("%zu %zu", sizeof(hr_scene), sizeof(hr_info)); return 0; }')
    subprocess.run([compiler, f"-I{HEADER.parent}", "-o", "a", "a.c"], cwd=tmp_path, check=True)
    offsets = subprocess.run([str(tmp_path / "a")], capture_output=True, text=True, check=True).stdout.split()
    import ctypes

    ours = [getattr(struct, field).offset for _, struct in fields for field, *_ in struct._fields_]
    assert list(map(int, offsets)) == [*ours, ctypes.sizeof(SceneStruct), ctypes.sizeof(InfoStruct)]
