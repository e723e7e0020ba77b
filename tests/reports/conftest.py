from __future__ import annotations

from pathlib import Path

import pytest
from reports_synthetic import lobe_recording, synthetic_results, tip_recording

from hapticeval.recordings.hdf5 import write_recording
from hapticeval.runner.results import ResultsDocument, write_results


@pytest.fixture
def results() -> ResultsDocument:
    return synthetic_results()


@pytest.fixture
def folder(tmp_path: Path, results: ResultsDocument) -> Path:
    write_results(tmp_path, results)
    write_recording(tmp_path / results.runs[0].recording, lobe_recording())
    write_recording(tmp_path / results.runs[2].recording, tip_recording())
    return tmp_path
