"""One finding of a check for a recording with gaps: what it found in each stretch, weighed together."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

from hapticeval.phenomena.verdict import Finding, Outcome

RANK = (Outcome.FAIL, Outcome.ERROR, Outcome.PASS, Outcome.INCONCLUSIVE, Outcome.NOT_APPLICABLE)
"""What one stretch shows outranks what another leaves open: a failure anywhere is one, and so is a question settled."""


def merged(findings: Sequence[Finding]) -> Finding:
    """The finding that decides: of the highest rank, with the smallest margin for its bound.

    Its message and evidence say in how many stretches the check came to what.
    """
    if not findings:
        return Finding(Outcome.INCONCLUSIVE, "no stretch of the recording is long enough to judge")
    if len({(each.outcome, each.message, each.metric) for each in findings}) == 1:
        return findings[0]
    outcome = min((each.outcome for each in findings), key=RANK.index)
    index, worst = min(
        ((index, each) for index, each in enumerate(findings) if each.outcome is outcome),
        key=lambda pair: _margin(pair[1]),
    )
    counts = Counter(each.outcome.value for each in findings)
    told = ", ".join(f"{counts[each.value]} {each.value}" for each in RANK if counts[each.value])
    return replace(
        worst,
        message=f"{worst.message} (stretch {index + 1} of {len(findings)}: {told})",
        evidence={**worst.evidence, "stretch": index + 1, "stretches": dict(counts)},
    )


def _margin(finding: Finding) -> float:
    """The margin as a share of the bound; findings without numbers come last."""
    if finding.margin is None or finding.bound is None:
        return float("inf")
    return finding.margin / finding.bound if finding.bound > 0.0 else finding.margin
