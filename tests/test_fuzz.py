"""`make fuzz` starts, runs a property and says what it found: nothing else runs its rounds."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest


@pytest.mark.system
def test_a_round_of_one_property() -> None:
    root = Path(__file__).parents[1]
    command = [sys.executable, "tests/fuzz.py", "0.001", "tests/geometry/test_motion.py"]
    completed = subprocess.run(command, cwd=root, capture_output=True, text=True, check=False)
    assert completed.returncode == 0, completed.stdout + completed.stderr
    assert "0 properties fail" in completed.stdout
