"""The example of a driver, with a card that is a twin."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from robots import recorded, twin_of

from hapticeval.discovery import load
from hapticeval.errors import InputError
from hapticeval.hardware.device import HardwareDevice
from hapticeval.hardware.wiring import read_wiring

EXAMPLES = Path(__file__).parents[2] / "examples"


class Card:
    """What the example expects of a card's library."""

    def __init__(self, twin):
        self.twin, self.reading, self.commands, self.closed = twin, None, [], False

    def wait_for_tick(self, timeout):
        self.reading = self.twin.read()
        return self.reading.sequence

    def encoders(self):
        return self.reading.raw.astype(int).tolist()

    def analog_out(self, command):
        self.commands.append(command)
        self.twin.write(command)

    def close(self):
        self.closed = True


@pytest.fixture
def example(monkeypatch):
    monkeypatch.syspath_prepend(str(EXAMPLES))
    wiring = read_wiring(EXAMPLES / "rig.toml")
    card = Card(twin_of(wiring))
    monkeypatch.setitem(sys.modules, "daq", SimpleNamespace(open=lambda *_, **__: card))
    importlib.invalidate_caches()
    yield card, wiring
    sys.modules.pop("my_card", None)


def test_it_is_short_runs_and_stops(tmp_path, example):
    code = [line for line in (EXAMPLES / "my_card.py").read_text().split('"""', 2)[2].splitlines() if line.strip()]
    assert len(code) <= 25
    card, wiring = example
    driver = load("my_card:MyCard", kind="driver")()
    assert isinstance(driver, HardwareDevice)
    live, recording = recorded(tmp_path, driver, wiring, cycles=300)
    assert (live.cycles, live.missed, len(recording)) == (300, 0, 300)
    assert np.any(recording.force != 0.0)
    assert card.closed
    np.testing.assert_array_equal(card.commands[-1], [0.0, 0.0])


@pytest.mark.parametrize(
    "name",
    [
        "my_card",
        "no_such_card:MyCard",
        "my_card:YourCard",
    ],
)
def test_a_driver_that_is_not_there_is_told(refused, example, name):
    with refused(InputError):
        load(name, kind="driver")
