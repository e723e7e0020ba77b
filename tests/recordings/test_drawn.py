"""What recordings' core makes of drawn numbers is what it made before: energies, quanta and clocks of every kind.

Nothing here is right or wrong by itself: the definitions are in `test_energy_balance.py` and
`test_recording_by_definition.py`. What is drawn covers what these leave out, such as which of several rests is the
worst. Where a change means to change a number, run this file with HAPTICEVAL_PUBLISH=1 and look at the difference in
`drawn.csv`.
"""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from publishing import publishing

from hapticeval.files import replacing
from hapticeval.recordings.energy_balance import balance
from hapticeval.recordings.quantization import coarsest, numeric_step, quantization_step, single_precision_step
from hapticeval.recordings.recording import Clock, Recording, runs_of
from hapticeval.recordings.stretches import continuing_steps, describe_clock, nominal_step, steps, stretches

TABLE = Path(__file__).with_name("drawn.csv")
DRAWS = 40
EXACT, TINY = 1e-6, 1e-15
Facts = Iterator[tuple[str, Any]]


def energies(rng: np.random.Generator) -> Facts:
    """A hand that goes to and fro over a spring, rests here and there and leaves it; one of five ways is wrong."""
    count, dimension = int(rng.integers(2, 400)), int(rng.integers(1, 4))
    time = np.cumsum(rng.choice([1e-3, 2e-3], count) if rng.integers(2) else np.full(count, 1e-3))
    phase = np.cumsum(np.where(np.sin(0.07 * np.arange(count) + rng.uniform(0.0, 6.0)) > 0.3, 0.0, 0.05))
    place = np.outer(0.01 * np.sin(phase) + 0.004 * np.sin(0.31 * phase), rng.standard_normal(dimension))
    quantum = float(rng.choice([0.0, 1e-6, 1e-4]))
    place = place if quantum == 0.0 else quantum * np.rint(place / quantum)
    force = -1000.0 * np.where(place[:, :1] < float(rng.choice([0.0, 0.004, 1.0])), place, 0.0)
    force *= float(rng.choice([1.0, -1.0])) * (1.0 + rng.choice([0.0, 0.3]) * (np.gradient(place[:, :1], axis=0) > 0.0))
    force = np.roll(force, int(rng.integers(0, 4)), axis=0) + float(rng.choice([0.0, 0.0, 0.02])) * rng.standard_normal(
        force.shape
    )
    if rng.integers(2):
        force = force.astype(np.float32).astype(float)
    runs = runs_of(~np.any(force != 0.0, axis=1))
    free = [end for first, end in runs if end - first >= 20 and end < count]
    if free and rng.integers(2):  # to the row after the hand has left free space
        place, force, time = (values[: free[-1] + 1] for values in (place, force, time))
    for name, sign in (("logged", 1.0), ("turned", -1.0)):
        for lag, gift in enumerate(balance(place, sign * force, time)):
            for field in ("energy", "open", "first", "last", "explained", "how"):
                yield f"{name}.{lag}.{field}", getattr(gift, field)


def quanta(rng: np.random.Generator) -> Facts:
    """Columns on a lattice, in few digits or in single precision, off by a little, and few or many of them."""
    for number in range(8):
        values = rng.standard_normal(int(rng.choice([3, 30, 60, 900]))) * 10.0 ** rng.uniform(-6.0, 6.0)
        step = float(np.max(np.abs(values)) * 10.0 ** rng.uniform(-8.0, -1.0))
        kind = int(rng.integers(5))
        if kind == 1:
            values = step * np.rint(values / step)
        elif kind == 2:
            values = step * (
                np.rint(values / step) + float(rng.choice([1e-6, 0.01, 0.019, 0.021])) * np.sin(values / step)
            )
        elif kind == 3:
            values = np.array([float(f"{value:.{int(rng.integers(2, 12))}e}") for value in values])
        elif kind == 4:
            values = values.astype(np.float32).astype(float)
        yield f"lattice.{number}", numeric_step(values)
        yield f"step.{number}", quantization_step(values)
        yield f"single.{number}", single_precision_step(values)
        yield f"coarsest.{number}", coarsest(np.column_stack([values, values[::-1] * 1.5]))


def clocks(rng: np.random.Generator) -> Facts:
    """Stamps that jitter, lack rows, are numbered or not, and rows that are not valid."""
    count = int(rng.integers(2, 40))
    cycle = int(rng.choice([1_000_000, 333_333, 2_000_000]))
    cycles = np.cumsum(rng.choice([1, 1, 1, 1, 1, 2, 4, 5, 6], count))
    jitter = int(rng.choice([1, 2, 1000, 100_000]))
    stamps = cycles * cycle + rng.integers(0, jitter, count)
    valid = None if rng.integers(2) else rng.uniform(size=count) < 0.9
    meta = [{}, {"dt": cycle / 1e9}, {"dt": 1.1e-9 + cycle / 1e9}, {"dt": 0.9e-9 + cycle / 1e9}][int(rng.integers(4))]
    clock = Clock(stamps, sequence=cycles if rng.integers(2) else None)
    points = rng.integers(0, 2, (count, 2)) * 1.0
    channels = {"hip": points, "ihip": points * rng.choice([1.0, 1.0 + 1e-7, 1.0 + 6e-7]), "force": 0.0 * points}
    recording = Recording.clocked(clock, channels, meta, valid=valid)
    parts = stretches(recording)
    yield "missed", clock.missed
    yield "dt", recording.dt
    yield "nominal", nominal_step(recording)
    yield "goes_on", "".join(map(str, continuing_steps(recording).astype(int)))
    yield "sound", " ".join(f"{rows.start}:{rows.stop}" for rows in recording.sound_rows())
    yield "touches", "".join(map(str, recording.contact.astype(int)))
    for number, part in enumerate(parts):
        yield f"rows.{number}", f"{part.first}:{part.end}"
        yield f"times.{number}", part.times(recording)
        yield f"took.{number}", float(np.sum(steps(recording, part)))
    if parts:
        yield "words", describe_clock(recording, parts)


DRAWN: dict[str, Callable[[np.random.Generator], Facts]] = {"energies": energies, "quanta": quanta, "clocks": clocks}


def read() -> dict[tuple[str, str, str], str]:
    rows = csv.reader(TABLE.read_text(encoding="utf-8").splitlines()) if TABLE.exists() else ()
    return {(kind, draw, name): text for kind, draw, name, text in rows}


@pytest.mark.parametrize("kind", DRAWN)
def test_what_is_drawn_gives_what_is_recorded(kind):
    facts = {
        (kind, str(draw), name): value
        for draw in range(DRAWS)
        for name, value in DRAWN[kind](np.random.default_rng(draw))
    }
    if publishing():
        table = {place: text for place, text in read().items() if place[0] != kind}
        table |= {place: f"{value:.9g}" if isinstance(value, float) else str(value) for place, value in facts.items()}
        with replacing(TABLE) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
            csv.writer(file, lineterminator="\n").writerows((*place, text) for place, text in table.items())
    recorded = {place: text for place, text in read().items() if place[0] == kind}
    assert facts.keys() == recorded.keys()
    for place, value in facts.items():
        if isinstance(value, float):
            assert value == pytest.approx(float(recorded[place]), rel=EXACT, abs=TINY), place
        else:
            assert str(value) == recorded[place], place
