"""The library built, and judged in a case that it passes: add those that it should pass next."""

import subprocess
from pathlib import Path

import hapticeval

HERE = Path(__file__).parent


def test_it_presses_on_a_plane() -> None:
    subprocess.run(["make"], cwd=HERE, check=True)
    results = hapticeval.run(f"lib:{HERE}/libpenalty.so", select="plane-press")
    assert results.complete
    assert [verdict.check for verdict in results.verdicts if verdict.outcome != "pass"] == []
