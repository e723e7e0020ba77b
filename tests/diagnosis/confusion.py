"""Planted causes against those that are named, as the table of docs/diagnosis.md.

`python tests/diagnosis/confusion.py SITUATIONS SEED...` plants each fault in so many drawn situations of each seed,
in the answers of a renderer and in a noisy log of them.
"""

from __future__ import annotations

import sys
import time
from collections import Counter, defaultdict
from collections.abc import Iterator

import numpy as np
from planted_causes import (
    COUPLED_FAULTS,
    FAULTS,
    IHIP_FAULTS,
    Fault,
    Planted,
    Situation,
    as_logged,
    draw_situation,
    is_planted,
    with_coupled_tool,
)

from hapticeval.diagnosis import Diagnosis, diagnose, right_contact

EXACT = 1.0 - 1e-9
"""Share from which on another cause explains all that the planted one does: the path does not tell them apart."""

SMALLEST_EFFECT = 0.01
"""Share of the force that a fault has to make in a log, to be counted: less is within what encoders leave."""

OUTCOMES = ("on top", "listed", "as exact", "unexplained", "missed", "wrong")


def outcome_of(kind: str, diagnosis: Diagnosis) -> str:
    """Return how a planted kind was found."""
    if not diagnosis.off:
        return "missed"
    if diagnosis.cause is None:
        return "unexplained"
    if is_planted(kind, diagnosis.kind):
        return "on top"
    if any(is_planted(kind, cause.kind) for cause in diagnosis.alike):
        return "listed"
    return "as exact" if diagnosis.share > EXACT else "wrong"


def plants() -> Iterator[tuple[str, str, Fault]]:
    """Yield what is planted where: kind, the channel, and the fault."""
    for kind, plant in FAULTS.items():
        yield kind.strip(), "force", plant
    for kind, plant in IHIP_FAULTS.items():
        yield kind.strip(), "contact point", plant
    for kind, plant in COUPLED_FAULTS.items():
        yield kind, "force of a tied tool", plant


def diagnose_log(planted: Planted, situation: Situation) -> Diagnosis:
    """Diagnose what sensors show of a planted fault."""
    hip, force = as_logged(planted, situation)
    boundary, contact = situation.model.boundary, situation.contact
    logged = right_contact(boundary, contact.time, hip, stiffness=contact.stiffness, damping=situation.damping)
    return diagnose(logged, force, noisy=True)


def main(count: int, *seeds: int) -> None:
    """Plant everything in `count` situations of each seed, and print the two tables."""
    seconds: list[float] = []
    tables: dict[str, dict[tuple[str, str], Counter[str]]] = {
        "renderer": defaultdict(Counter),
        "log": defaultdict(Counter),
    }
    alarms = Counter[str]()
    for rng in (rng for rng in map(np.random.default_rng, seeds) for _ in range(count)):
        rigid = draw_situation(rng)
        tied = with_coupled_tool(rigid)
        right = Planted(rigid.contact.force, rigid.contact.point)
        alarms["renderer"] += diagnose(rigid.contact, *right).off
        alarms["log"] += diagnose_log(right, rigid).off
        for kind, channel, plant in plants():
            situation = tied if plant in COUPLED_FAULTS.values() else rigid
            contact, planted = situation.contact, plant(situation)
            effect = np.linalg.norm(planted.force - contact.force) / np.linalg.norm(contact.force)
            if effect > 1e-4:
                begin = time.process_time()
                diagnosis = diagnose(contact, planted.force, planted.ihip)
                seconds.append(time.process_time() - begin)
                outcome = outcome_of(kind, diagnosis)
                tables["renderer"][kind, channel][outcome] += 1
                if outcome == "wrong":
                    print(f"{kind} of the {channel}: {diagnosis.sentence}", file=sys.stderr)
            if channel == "force" and effect > SMALLEST_EFFECT:
                diagnosis = diagnose_log(planted, situation)
                outcome = outcome_of(kind, diagnosis)
                tables["log"][kind, channel][outcome] += 1
                if outcome == "wrong":
                    print(f"{kind} in a log: {diagnosis.sentence}", file=sys.stderr)
    for source, table in tables.items():
        whole = sum(table.values(), Counter())
        print(f"\n{source}: {whole.total()} planted, false alarms {alarms[source]} of {count * len(seeds)}\n")
        print(f"| planted | of | {' | '.join(OUTCOMES)} |\n|---|---|{'---|' * len(OUTCOMES)}")
        for (kind, channel), row in table.items():
            print(f"| {kind} | {channel} | {' | '.join(str(row[outcome]) for outcome in OUTCOMES)} |")
        shares = (f"{100.0 * whole[outcome] / whole.total():.1f} %" for outcome in OUTCOMES)
        print(f"| all | | {' | '.join(shares)} |")
    print(f"\n{1e3 * np.median(seconds):.0f} ms of the processor in the median")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
