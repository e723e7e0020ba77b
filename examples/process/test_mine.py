"""The process judged in a case that it passes: add those that it should pass next."""

import shlex
import sys
from pathlib import Path

import hapticeval

COMMAND = shlex.join([sys.executable, str(Path(__file__).with_name("mine.py"))])


def test_it_goes_round_a_star() -> None:
    results = hapticeval.run(f"cmd:{COMMAND}", select="star-loops")
    assert results.complete
    assert [verdict.check for verdict in results.verdicts if verdict.outcome != "pass"] == []
