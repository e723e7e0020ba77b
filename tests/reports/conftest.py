from __future__ import annotations

from pathlib import Path

import pytest
from reports_synthetic import lobe_recording, synthetic_results, tip_recording

from hapticeval.recordings.hdf5 import write_recording
from hapticeval.reports import write_reports
from hapticeval.runner.results import ResultsDocument, write_results


@pytest.fixture
def results() -> ResultsDocument:
    return synthetic_results()


def fill(folder: Path) -> Path:
    """Write results and the recordings of two of its runs, without a report."""
    results = synthetic_results()
    write_results(folder, results)
    write_recording(folder / results.runs[0].recording, lobe_recording())
    write_recording(folder / results.runs[2].recording, tip_recording())
    return folder


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return fill(tmp_path)


@pytest.fixture(scope="session")
def reported(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with its report, for tests that only read it or a copy."""
    folder = fill(tmp_path_factory.mktemp("reported"))
    write_reports(folder, workers=0)
    return folder
