"""The pytest plugin, in runs of pytest of their own: items, ids, outcomes, failure texts, and what it costs unused."""

import io

import pytest

import hapticeval
from hapticeval import pytest_plugin
from hapticeval.cli import main

pytest_plugins = "pytester"

DRAW_PICTURE = pytest_plugin._draw_picture


@pytest.fixture(scope="module", autouse=True)
def _loaded():
    """Import all that a run imports: pytester forgets what is imported in its runs, and numba cannot be forgotten."""
    results = hapticeval.run("constraint", select="plane-impact or cassinian-deep-slide/memoryless", workers=0)
    results.plot("plane-impact").savefig(io.BytesIO(), format="svg")


TESTS = """
import pytest
from hapticeval.cli import main
from local_mine import Good, Jumps

@pytest.mark.hapticeval(suite="slides.toml", select="not flat-again", known="known.toml")
def test_jumps(hapticeval):
    hapticeval(Jumps)

@pytest.mark.hapticeval(suite="slides.toml", select="flat", renderer="local_mine:Good")
def test_named(hapticeval):
    assert hapticeval().outcome == "pass"

def test_good(hapticeval):
    results = hapticeval(Good, suite="slides.toml")
    assert len(results.verdicts) == 4

def test_all_jumps(hapticeval):
    hapticeval("local_mine:Jumps", suite="slides.toml", select="flat-back")
"""
KNOWN = '[[known]]\nrenderer = "{}"\nreason = "a limit of the method"\nverdicts = ["slides/flat/continuous-contact"]\n'
JUMPS = ["--hapticeval", "local_mine:Jumps", "--hapticeval-suite", "slides.toml"]
FLAT = "hapticeval::slides::flat"


@pytest.fixture
def folder(pytester, here, monkeypatch):
    """Pytest's own temporary folder, with the suite and the renderers of `here`; no picture is drawn."""
    for file in ("local_mine.py", "slides.toml"):
        (pytester.path / file).write_text((here / file).read_text())
    monkeypatch.chdir(pytester.path)
    monkeypatch.delenv("PYTEST_ADDOPTS", raising=False)
    monkeypatch.setattr(pytest_plugin, "_draw_picture", lambda *_: "not drawn")
    pytester.syspathinsert(pytester.path)
    return pytester


def ids(result):
    return [line for line in result.outlines if line.startswith("hapticeval::")]


def test_an_item_a_verdict(folder):
    result = folder.runpytest(*JUMPS, "--collect-only", "-q")
    assert ids(result) == [
        f"{FLAT}::continuous-contact[local_mine:Jumps]",
        f"{FLAT}::memoryless[local_mine:Jumps]",
        "hapticeval::slides::flat-back::continuous-contact[local_mine:Jumps]",
        "hapticeval::slides::flat-again::continuous-contact[local_mine:Jumps]",
    ]


def test_what_fails_shows_metric_bound_place_and_picture(folder, monkeypatch):
    monkeypatch.setattr(pytest_plugin, "_draw_picture", DRAW_PICTURE)
    result = folder.runpytest(*JUMPS, "--hapticeval-select", "flat", "-v")
    result.assert_outcomes(passed=1, failed=1)
    result.stdout.fnmatch_lines(
        [
            f"{FLAT}::continuous-contact* FAILED*",
            f"{FLAT}::memoryless* PASSED*",
            "continuous-contact on local_mine:Jumps, slides/flat: fail",
            "  pop-through: the IHIP jumps 20 mm at t = 0.107 s, *",
            "  IHIP jump that refinement leaves = 20 mm, bound 0.1425 mm",
            "  at t = 0.107 s, HIP (10.1*, -1) mm, IHIP (20, 0) mm",
            "  picture: .pytest_cache/d/hapticeval/slides-flat-local_mine-jumps*.svg",
        ]
    )
    result.stdout.no_fnmatch_line("*Traceback*")
    (picture,) = (folder.path / ".pytest_cache" / "d" / "hapticeval").iterdir()
    assert "<svg" in picture.read_text()


@pytest.mark.parametrize(
    ("arguments", "passed", "failed"),
    [
        ([f"{FLAT}::memoryless[local_mine:Jumps]"], 1, 0),
        ([f"{FLAT}::memoryless", "hapticeval::slides::flat-back"], 1, 1),
        (["hapticeval", "-k", "memoryless"], 1, 0),
        (["-m", "not hapticeval", "test_other.py"], 1, 0),
        (["test_other.py", FLAT], 2, 1),
    ],
)
def test_ids_expressions_and_markers_select(folder, arguments, passed, failed):
    (folder.path / "test_other.py").write_text("def test_other():\n    pass\n")
    folder.runpytest(*JUMPS, *arguments).assert_outcomes(passed=passed, failed=failed, deselected=None)


def test_what_failed_the_last_time_is_selected(folder):
    folder.runpytest(*JUMPS).assert_outcomes(passed=1, failed=3)
    folder.runpytest(*JUMPS, "--last-failed").assert_outcomes(failed=3, deselected=1)


@pytest.mark.parametrize(
    ("renderer", "strict", "outcomes"),
    [
        ("local_mine:Jumps", [], {"xfailed": 1, "passed": 1}),
        ("local_mine:Jumps", ["--hapticeval-strict"], {"xfailed": 1, "passed": 1}),
        ("local_mine:Good", [], {"xpassed": 1, "passed": 1}),
        ("local_mine:Good", ["--hapticeval-strict"], {"failed": 1, "passed": 1}),
    ],
)
def test_known_failures_are_expected(folder, renderer, strict, outcomes):
    (folder.path / "known.toml").write_text(KNOWN.format(renderer))
    result = folder.runpytest(
        "--hapticeval", renderer, *JUMPS[2:], "--hapticeval-known", "known.toml", *strict, FLAT, "-rxX"
    )
    result.assert_outcomes(**outcomes)
    result.stdout.fnmatch_lines(["*a limit of the method*"])


def test_a_failure_that_is_worse_than_the_known_one_fails(folder):
    assert main(["run", "slides.toml", "-r", "local_mine:Jumps", "--no-report", "--write-known", "known.toml"]) == 0
    known = [*JUMPS, "--hapticeval-known", "known.toml", f"{FLAT}::continuous-contact"]
    listed = folder.runpytest(*known)
    listed.assert_outcomes(xfailed=1)
    listed.stdout.fnmatch_lines([NOTES[0], "known.toml lists 3 verdicts with a reason that is 'not explained yet'*"])
    listed.stdout.no_fnmatch_line("*without a size*")
    text = (folder.path / "known.toml").read_text()
    assert "metric = 0.02," in text
    (folder.path / "known.toml").write_text(text.replace("metric = 0.02,", "metric = 0.001,"))
    worse = folder.runpytest(*known)
    worse.assert_outcomes(failed=1)
    worse.stdout.fnmatch_lines(["*worse than known: 20 mm, and known is 1 mm (not explained yet*"])


UNUSUAL = (
    KNOWN + KNOWN.replace("{}", "local_mine:Godo") + KNOWN.replace("{}", "constraint").replace("slides/", "slide/")
)
NOTES = [
    "*known failures of hapticeval*",
    "known.toml lists 'local_mine:Godo' (1 verdict), which does not run here: did you mean local_mine:Good?",
    "known.toml lists suite 'slide' (1 verdict), which does not run here: did you mean slides?",
    "known.toml lists 3 failures without a size, and so excuses them at any size: *--write-known known.toml*",
    "known, and pass now: local_mine:Good on slides/flat/continuous-contact",
    "  take it off the list: a limit of the method",
]


def test_the_summary_shows_what_is_odd_on_the_list(folder):
    (folder.path / "known.toml").write_text(UNUSUAL.format("local_mine:Good"))
    chosen = ["--hapticeval-suite", "slides.toml", "--hapticeval-known", "known.toml", FLAT]
    folder.runpytest("--hapticeval", "local_mine:Good", *chosen).stdout.fnmatch_lines(NOTES, consecutive=True)


def test_a_published_failure_that_passes_fails_and_a_broken_renderer_shows_its_cause(folder):
    differs = folder.runpytest("--hapticeval", "local_mine:Differs", *JUMPS[2:], f"{FLAT}::continuous-contact")
    differs.assert_outcomes(failed=1)
    differs.stdout.fnmatch_lines(["continuous-contact on local_mine:Differs, slides/flat: pass", "  published: fail"])
    breaks = folder.runpytest("--hapticeval", "local_mine:Breaks", *JUMPS[2:], f"{FLAT}::memoryless")
    breaks.stdout.fnmatch_lines(["  the renderer's step() raised OSError: the sensor is gone at tick 106*"])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--hapticeval", "local_mine:Absent", *JUMPS[2:]], "*has no 'Absent'*"),
        ([*JUMPS[:3], "absent.toml"], "*no suite file*absent.toml*"),
        ([*JUMPS, "--hapticeval-select", "memoriless"], "*did you mean memoryless?*"),
        ([*JUMPS, "--hapticeval-known", "absent.toml"], "*no list of known failures*absent.toml*"),
        ([*JUMPS, "hapticeval::slides::flta"], "*no verdict has the id hapticeval::slides::flta*"),
        ([FLAT], "*needs --hapticeval RENDERER*"),
    ],
)
def test_what_the_user_gets_wrong_is_shown_in_a_word(folder, arguments, message):
    result = folder.runpytest(*arguments)
    assert result.ret != 0
    text = "\n".join([*result.outlines, *result.errlines])
    assert "Traceback" not in text
    assert "INTERNALERROR" not in text
    result.stdout.fnmatch_lines([message]) if result.outlines else result.stderr.fnmatch_lines([message])


def test_fixture_and_marker(folder):
    (folder.path / "known.toml").write_text(KNOWN.format("Jumps") + KNOWN.format("Jump"))
    (folder.path / "test_mine.py").write_text(TESTS)
    result = folder.runpytest("-rA")
    result.assert_outcomes(passed=4, failed=2, xfailed=1)
    result.stdout.fnmatch_lines(["known.toml lists 'Jump' (1 verdict), which does not run here: did you mean Jumps?"])
    result.stdout.fnmatch_lines(
        [
            "*continuous-contact on local_mine:Jumps, slides/flat-back: fail",
            "PASSED test_mine.py::test_jumps[[]slides/flat/memoryless[]]",
            "XFAIL test_mine.py::test_jumps[[]slides/flat/continuous-contact[]] - a limit of the method",
            "FAILED test_mine.py::test_jumps[[]slides/flat-back/continuous-contact[]]*",
        ]
    )


@pytest.mark.parametrize("marked", ["suite='absent.toml'", "known='absent.toml'", "suites='slides.toml'", "'slides'"])
def test_a_marker_that_cannot_be_meant_is_refused(folder, marked):
    test = f"import pytest\n@pytest.mark.hapticeval({marked})\ndef test_it(hapticeval):\n    hapticeval(None)\n"
    (folder.path / "test_mine.py").write_text(test)
    result = folder.runpytest()
    assert result.ret != 0
    assert "@pytest.mark.hapticeval" in "\n".join([*result.outlines, *result.errlines])


@pytest.mark.system
def test_processes_share_the_items(folder):
    (folder.path / "known.toml").write_text(UNUSUAL.format("local_mine:Good"))
    known = ["--hapticeval-known", "known.toml"]
    result = folder.runpytest_subprocess(
        "--hapticeval", "local_mine:Good", *JUMPS[2:], *known, "-n", "2", "--dist", "loadgroup"
    )
    result.assert_outcomes(passed=3, xpassed=1)
    result.stdout.fnmatch_lines(NOTES, consecutive=True)


UNUSED = """
import sys
def pytest_sessionfinish():
    print("loaded:", *sorted(name for name in sys.modules if name.startswith("hapticeval")))
    print("heavy:", *sorted({"numba", "numpy", "scipy", "matplotlib", "msgspec"} & set(sys.modules)))
"""


def test_it_loads_nothing_where_it_is_not_used(folder):
    (folder.path / "conftest.py").write_text(UNUSED)
    (folder.path / "test_other.py").write_text("def test_other():\n    pass\n")
    result = folder.runpytest_subprocess("-s", "-p", "no:benchmark", "-p", "no:hypothesispytest")
    result.assert_outcomes(passed=1)
    result.stdout.fnmatch_lines(["*loaded: hapticeval hapticeval.pytest_plugin hapticeval.suite", "heavy:"])
