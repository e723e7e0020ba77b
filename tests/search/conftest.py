"""Renderers in a file of the user's own, as `-r mine:Renderer` names them."""

from __future__ import annotations

import sys

import pytest

MINE = '''
import os, time
from pathlib import Path
import numpy as np
from hapticeval import Response

class Nearest:
    """A spring to the nearest point of the surface."""
    def __init__(self, scene):
        self.scene, self.closest = scene, scene.model.boundary.closest_point
    def reset(self, hip):
        pass
    def step(self, hip, velocity, dt):
        found = self.closest(hip[np.newaxis])
        if found.distance[0] >= 0.0:
            return Response(hip, np.zeros_like(hip))
        return Response(found.foot[0], self.scene.stiffness * (found.foot[0] - hip))

class Raises(Nearest):
    """Raises where the hand is deeper than 3 mm."""
    def step(self, hip, velocity, dt):
        answer = super().step(hip, velocity, dt)
        if np.linalg.norm(answer.ihip - hip) > 3e-3:
            self.bad(hip)
        return answer
    def bad(self, hip):
        raise ZeroDivisionError(f"at {hip}")

class Dies(Raises):
    def bad(self, hip):
        os._exit(9)

class Hangs(Raises):
    def bad(self, hip):
        Path(__file__).with_name("hangs").touch()
        time.sleep(3600)

class Slow(Nearest):
    def step(self, hip, velocity, dt):
        time.sleep(2e-3)
        return super().step(hip, velocity, dt)

class Ticks(Nearest):
    """Depends on the length of a tick by one per cent."""
    def step(self, hip, velocity, dt):
        ihip, force = super().step(hip, velocity, dt)
        return Response(ihip, force * (1.0 + 0.01 * (1e3 * dt - 1.0)))

class Keeps(Nearest):
    """Keeps over a reset that it was in contact: a second contact is softer."""
    softer = 1.0
    def reset(self, hip):
        self.softer = 0.99 if self.__dict__.get("touched") else 1.0
    def step(self, hip, velocity, dt):
        ihip, force = super().step(hip, velocity, dt)
        self.touched = self.__dict__.get("touched") or bool(force.any())
        return Response(ihip, self.softer * force)

class Mirrored(Nearest):
    """Its normal has the wrong sign in x."""
    def step(self, hip, velocity, dt):
        ihip, force = super().step(hip, velocity, dt)
        return Response(ihip, force * [-1.0, 1.0])

class Stale(Nearest):
    """Answers every fiftieth tick with the answer of the tick before."""
    def reset(self, hip):
        self.tick, self.last = 0, None
    def step(self, hip, velocity, dt):
        answer = super().step(hip, velocity, dt)
        self.tick += 1
        answer, self.last = (self.last if self.tick % 50 == 0 else answer), answer
        return answer

class SecondLap(Nearest):
    """Half as stiff at one corner, from the second lap on."""
    def reset(self, hip):
        self.angle, self.turned = None, 0.0
    def step(self, hip, velocity, dt):
        ihip, force = super().step(hip, velocity, dt)
        angle = np.arctan2(ihip[1], ihip[0])
        self.turned += 0.0 if self.angle is None else (angle - self.angle + np.pi) % (2.0 * np.pi) - np.pi
        self.angle = angle
        corner = self.scene.model.boundary.corners[2].position
        wrong = abs(self.turned) > 2.0 * np.pi and np.linalg.norm(ihip - corner) < 4e-3
        return Response(ihip, 0.5 * force if wrong else force)

class InPlane(Nearest):
    supports = frozenset({"plane"})

class InSpace(Nearest):
    supports = frozenset({"space"})

class Refuses:
    def __init__(self, scene):
        from hapticeval import RefusalError
        raise RefusalError("no model is good enough")
    def reset(self, hip): ...
    def step(self, hip, velocity, dt): ...
'''


@pytest.fixture
def mine(tmp_path, monkeypatch):
    """Put `mine.py` into the current directory, which is a folder of the test's own."""
    (tmp_path / "mine.py").write_text(MINE)
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    sys.modules.pop("mine", None)
    yield tmp_path
    sys.modules.pop("mine", None)
