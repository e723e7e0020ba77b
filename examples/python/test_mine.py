"""The renderer judged, in cases that it passes: add those that it should pass next."""

from mine import Nearest

import hapticeval


def test_it_presses_on_a_plane() -> None:
    results = hapticeval.run(Nearest, select="plane-press")
    assert results.complete
    assert [verdict.check for verdict in results.verdicts if verdict.outcome != "pass"] == []
