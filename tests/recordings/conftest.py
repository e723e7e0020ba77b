"""Every test of recordings runs in an empty current directory."""

import pytest


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    """The directory."""
    monkeypatch.chdir(tmp_path)
    return tmp_path
