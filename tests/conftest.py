"""What every test shares: no display, a thread each, Ctrl-C as ever, and hypothesis that draws the same, untimed."""

from __future__ import annotations

import gc
import os
import signal
import sys
from contextlib import suppress
from pathlib import Path

os.environ.setdefault("MPLBACKEND", "Agg")
# Threads of linear algebra wait by spinning: two processes that share two cores would take up to three times as long.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import measured
import pytest
from hypothesis import HealthCheck, settings
from refusals import Refusals

# No clock decides a test: neither a deadline, nor how long examples take to draw.
UNTIMED = {"deadline": None, "suppress_health_check": [HealthCheck.too_slow]}
# The same examples each time: more of them find nothing the next time. `make fuzz` looks at 100 fresh ones a round.
settings.register_profile("repeatable", **UNTIMED, derandomize=True, max_examples=30)
settings.register_profile("fuzz", **UNTIMED, print_blob=True)  # chosen by --hypothesis-profile, see fuzz.py
settings.load_profile("repeatable")

# Hypothesis draws some numbers from the source of the modules that happen to be loaded. Which these are depends on the
# tests that ran before in the same process, and so would the examples. Hypothesis has no setting for that, so one
# of its functions is replaced. Where it has none of that name any more, tests/test_repeatable.py fails and says so.
with suppress(ImportError, AttributeError):
    pytest.MonkeyPatch().setattr("hypothesis.internal.conjecture.providers.is_local_module_file", lambda path: False)

# Started from a background job the tests inherit an ignored SIGINT, and would pass it on to the commands they start.
signal.signal(signal.SIGINT, signal.default_int_handler)


# A live loop freezes what there is, and lets go of it at its end.
gc.unfreeze = lambda: None
# What is imported and collected stays: to look through it for garbage meanwhile takes half as long as all of it.
gc.disable()


def pytest_collection_finish():
    """Leave what is loaded out of every collection of garbage, which would go through all of it."""
    gc.enable()
    gc.set_threshold(20_000, 20, 20)  # there is little garbage in cycles: that of a module goes with it
    gc.collect()
    gc.freeze()


def pytest_runtest_teardown(item, nextitem):
    """Do so again after each module: what its tests have imported stays too."""
    if nextitem is None or nextitem.path != item.path:
        gc.collect()
        gc.freeze()


def pytest_addoption(parser):
    parser.addoption("--measures", metavar="CHECK", help="only tests that name it or have its findings recorded")


def pytest_collection_modifyitems(config, items):
    """Mark the tests whose errors have their texts in the list, so that these alone can write it anew."""
    for item in items:
        if "refused" in getattr(item, "fixturenames", ()):
            item.add_marker("refusals")
    if check := config.getoption("--measures"):
        recorded = {f"tests/{place.renderer}" for place in measured.recorded() if place.check == check}
        names = (check, check.replace("-", "_"))
        items[:] = [item for item in items if item.nodeid in recorded or any(name in item.nodeid for name in names)]


@pytest.fixture
def refused(request, tmp_path, tmp_path_factory):
    """Expect an error of a type, with the text that stands in `refusals.csv`."""
    test = request.node.nodeid.removeprefix("tests/")
    folders = {
        "PYTHON": Path(sys.executable),
        "FOLDER": tmp_path,
        "TEMPORARY": tmp_path_factory.getbasetemp(),
        "REPOSITORY": Path(__file__).parents[1],
    }
    refusals = Refusals(test, folders)
    yield refusals
    refusals.compare()


@pytest.fixture(autouse=True)
def as_measured(request):
    """Hold what a test of the checks asks them against what they found before, for `make measures`.

    What hypothesis draws may change.
    """
    test = request.node.nodeid
    drawn = hasattr(request.function, "hypothesis") or request.node.get_closest_marker("system")
    if drawn or not measured.wanted() or not test.startswith(("tests/phenomena/", "tests/meta/")):
        yield
    else:
        with measured.watched(test.removeprefix("tests/")):
            yield


@pytest.fixture
def undrawn(monkeypatch):
    """Reports have no figures, for tests that ask nothing of them: a page draws for longer than its case is judged."""
    monkeypatch.setattr("hapticeval.reports.write.draw", lambda order: order.fallback("not drawn"))


@pytest.fixture
def unpictured(monkeypatch):
    """`inspect` draws no picture, which takes ten times as long as all that is found; other tests look at it."""
    monkeypatch.setattr("hapticeval.reports.integrity_figure.write_integrity", lambda *_, **__: [])


@pytest.fixture
def in_process(monkeypatch):
    """Commands judge and report in this process, where the kernels are loaded; for tests that are not of processes."""
    for module in ("api", "runner.execution", "workers"):
        monkeypatch.setattr(f"hapticeval.{module}.default_workers", lambda: 0)
