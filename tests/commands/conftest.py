"""A current directory with a suite of short slides and a module of renderers."""

import sys

import pytest
from slides import CASES, HEAD

PUBLISHED = '[case.published."local_mine:Differs"]\ncontinuous-contact = "fail"\n'
SUITE = HEAD + CASES["flat"] + PUBLISHED + CASES["flat-back"] + CASES["flat-again"]

MINE = """
import os, time
from pathlib import Path
import numpy as np

class Good:
    def __init__(self, scene):
        self.stiffness = scene.stiffness
    def reset(self, hip):
        pass
    def step(self, hip, velocity, dt):
        ihip = np.array([hip[0], max(hip[1], 0.0)])
        return ihip, self.stiffness * (ihip - hip)

class Differs(Good):
    pass

class Jumps(Good):
    def step(self, hip, velocity, dt):
        ihip = np.array([0.0 if hip[0] < 0.0101 else 0.02, 0.0])
        return ihip, self.stiffness * (ihip - hip)

class Breaks(Good):
    def step(self, hip, velocity, dt):
        if hip[0] > 0.01:
            raise OSError("the sensor is gone")
        return super().step(hip, velocity, dt)

class Waits(Good):
    "Stands still where `flat-back` begins, until a file says go."
    def step(self, hip, velocity, dt):
        if hip[0] == 0.02:
            Path("pid").write_text(str(os.getpid()))
            Path("pid").rename("waiting")
            while not Path("go").exists():
                time.sleep(0.02)
        return super().step(hip, velocity, dt)

def nothing(scene):
    return 3
"""


@pytest.fixture
def here(tmp_path, monkeypatch):
    """The folder, and no trace of it afterwards."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    monkeypatch.setenv("COLUMNS", "100")
    (tmp_path / "local_mine.py").write_text(MINE)
    (tmp_path / "slides.toml").write_text(SUITE)
    yield tmp_path
    sys.modules.pop("local_mine", None)
