"""Every test of recordings runs in an empty current directory."""

import pytest


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    """The directory."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def unpictured(monkeypatch):
    """`inspect` draws no picture, which takes ten times as long as all that is found; other tests look at it."""
    monkeypatch.setattr("hapticeval.reports.integrity_figure.write_integrity", lambda *_, **__: [])
