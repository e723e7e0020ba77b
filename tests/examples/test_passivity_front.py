"""What a passivity controller takes out of a lap is all that the lap would give, and what that costs is small."""

from __future__ import annotations

import json

import pytest

from hapticeval.examples.studies import passivity_front
from hapticeval.examples.studies.passivity_front import FrontPoint, measure


def test_once_the_store_is_spent_the_controller_takes_all_that_a_lap_would_give():
    point = measure("conformal", 4e-3)
    # 15.1 mJ a lap, turned by up to 45 degrees: see renderers/field/passivity_control.py.
    assert point.without == pytest.approx(15.1e-3, rel=0.02)
    assert abs(point.with_controller) < 1e-6 * point.without
    assert point.most_turned == pytest.approx(45.0, abs=2.0)
    assert 0.0 < point.turned < point.most_turned


def test_the_front_is_drawn_with_its_numbers(tmp_path, monkeypatch):
    monkeypatch.setattr(passivity_front, "measure", lambda inner, radius: FrontPoint(radius, radius, 0.0, 1.0, 2.0))
    assert passivity_front.main(["-o", str(tmp_path)]) == 0
    points = json.loads((tmp_path / "passivity-front.json").read_text())["mapping"]
    assert [point["without"] for point in points] == list(passivity_front.RADII)
    assert "turn of the force" in (tmp_path / "passivity-front.svg").read_text()
