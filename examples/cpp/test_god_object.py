"""The library built, and judged in the cases of blocks.toml: add those that it should pass next."""

import subprocess
from pathlib import Path

import hapticeval

HERE = Path(__file__).parent


def test_it_slides_over_blocks() -> None:
    subprocess.run(["make"], cwd=HERE, check=True)
    results = hapticeval.run(f"lib:{HERE}/libgod_object.so", suites=str(HERE / "blocks.toml"))
    assert results.complete
    assert [verdict.check for verdict in results.verdicts if verdict.outcome not in ("pass", "not-applicable")] == []
