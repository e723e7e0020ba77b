"""One renderer through one case: run it, and its siblings where a check asks, and let the checks judge."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from hapticeval.errors import DomainError, HapticevalError, RefusalError, RunawayError, describe_error
from hapticeval.phenomena.check import Runs, without_channel
from hapticeval.phenomena.inherent import Region, nearest_jump, reason_inherent, region_of
from hapticeval.phenomena.observed import Observed
from hapticeval.phenomena.registry import CHECKS
from hapticeval.phenomena.sampling import note_cut_standoff, worst_of
from hapticeval.phenomena.verdict import Facts, Finding, Level, Outcome, Verdict, undecided
from hapticeval.recordings.recording import MissingChannelError, Recording
from hapticeval.renderer import RendererFactory
from hapticeval.runner.results import Replay
from hapticeval.runner.siblings import SiblingRuns
from hapticeval.scene import Scene
from hapticeval.suite.case import Case


@dataclass(frozen=True, eq=False)
class Judged:
    """What came of one renderer in one case; `recording` is None where the renderer broke in the run that is judged.

    `closed_form` names the closed form of the renderer's law in this scene, if it has one. Where a run ended early,
    since device or law left its domain or the loop ran away, `ended` has tick and time (s), what and why.

    `step_seconds` is the median time of a step of the run that is judged, s. It is None where fewer than
    `siblings.FEWEST_TIMED_STEPS` were asked for one by one.
    """

    verdicts: tuple[Verdict, ...]
    recording: Recording | None
    error: HapticevalError | None
    refusal: RefusalError | None
    simulated_seconds: float
    wall_seconds: float
    ended: Mapping[str, Any] | None = None
    replay: Replay | None = None
    closed_form: str | None = None
    step_seconds: float | None = None


@dataclass(frozen=True, eq=False)
class Recorded:
    """What there is to judge: the `recording` as it is stored, and the `runs` that checks may read.

    A recording with gaps has several runs: each check judges every one, and `merge` of `judge_recorded` makes one
    finding of them. `replay` and `step_seconds` go into the results; `simulated` returns the seconds simulated so far.
    """

    recording: Recording
    runs: tuple[Runs, ...]
    replay: Replay | None = None
    simulated: Callable[[], float] = float
    step_seconds: float | None = None


def judge(factory: RendererFactory, renderer: str, suite: str, case: Case) -> Judged:
    """Judge the renderer that `factory` makes by every check of `case`.

    A check that breaks gives a verdict `error`, and the others go on. So does each check that asks for a sibling in
    which the renderer breaks; where it breaks in the base run, all verdicts are `error`.
    """

    def record(scene: Scene) -> Recorded:
        siblings = SiblingRuns(factory, scene, case, renderer)
        runs = siblings.runs()
        return Recorded(
            runs.base,
            siblings.judged_parts(runs),
            simulated=lambda: siblings.simulated,
            step_seconds=siblings.step_seconds,
        )

    return judge_recorded(record, merge_findings, renderer, suite, case)


def judge_recorded(
    record: Callable[[Scene], Recorded],
    merge: Callable[[Sequence[Finding]], Finding],
    renderer: str,
    suite: str,
    case: Case,
) -> Judged:
    """Judge what `record` returns for a case's scene by each of its checks; `merge` joins findings of several runs."""
    started = time.perf_counter()
    recorded: Recorded | None = None
    error: HapticevalError | None = None
    refusal: RefusalError | None = None
    ended: Mapping[str, Any] | None = None
    findings: list[Finding] = []
    try:
        scene = case.build_scene()
        recorded = record(scene)
        for check in case.checks:
            try:
                findings.append(merge([finding_of_check(check, runs, scene) for runs in recorded.runs]))
            except RunawayError as raised:
                findings.append(finding_of_runaway(_end_by(raised)))
            except HapticevalError as raised:
                # Broken in a sibling that this check asked for: others may not need it.
                findings.append(_error_finding(raised))
                error = error or raised
        if recorded.replay is None:
            ended = recorded.recording.meta.get("ended")
    except RefusalError as raised:
        refusal = raised
        # A refusal is not a failure: there is nothing to judge.
        findings = [Finding(Outcome.NOT_APPLICABLE, f"the renderer refuses: {raised.what}")] * len(case.checks)
    except RunawayError as raised:
        ended = _end_by(raised)
        findings = [finding_of_runaway(ended)] * len(case.checks)
    except HapticevalError as raised:
        error = raised
        findings = [_error_finding(raised)] * len(case.checks)
    declared = {} if recorded is None else recorded.recording.meta
    return Judged(
        verdicts_of_findings(findings, renderer, suite, case, declared),
        recording=None if recorded is None else recorded.recording,
        error=error,
        refusal=refusal,
        simulated_seconds=0.0 if recorded is None else recorded.simulated(),
        wall_seconds=time.perf_counter() - started,
        ended=ended,
        replay=None if recorded is None else recorded.replay,
        closed_form=None if recorded is None else next((runs.closed_form for runs in recorded.runs), None),
        step_seconds=None if recorded is None else recorded.step_seconds,
    )


RANK = (Outcome.FAIL, Outcome.ERROR, Outcome.PASS, Outcome.INCONCLUSIVE, Outcome.NOT_APPLICABLE)
"""What one stretch shows outranks what another leaves open: a failure anywhere is one, and so is a question settled."""


def merge_findings(findings: Sequence[Finding]) -> Finding:
    """Combine the findings of a check in each stretch: the worst outcome (`RANK`), then the smallest margin.

    Message and evidence state in how many stretches the check came to what.
    """
    if not findings:
        return Finding(Outcome.INCONCLUSIVE, "no stretch of the recording is long enough to judge")
    # All stretches say the same: nothing is to be counted.
    if len({(finding.outcome, finding.message, finding.metric) for finding in findings}) == 1:
        return findings[0]
    # By rank, then by margin: among failures the one that fails by most comes first.
    gravest = min((finding.outcome for finding in findings), key=RANK.index)
    candidates = [(index, finding) for index, finding in enumerate(findings) if finding.outcome is gravest]
    index, worst = worst_of(candidates, lambda candidate: -_margin(candidate[1]))
    counts = Counter(finding.outcome.value for finding in findings)
    stretches = ", ".join(f"{counts[outcome.value]} {outcome.value}" for outcome in RANK if counts[outcome.value])
    return replace(
        worst,
        message=f"{worst.message} (stretch {index + 1} of {len(findings)}: {stretches})",
        evidence={**worst.evidence, "stretch": index + 1, "stretches": dict(counts)},
    )


def _margin(finding: Finding) -> float:
    """Return the margin as a share of the bound; findings without numbers come last."""
    if finding.margin is None or finding.bound is None:
        return float("inf")
    return finding.margin / finding.bound if finding.bound > 0.0 else finding.margin


def error_verdicts(error: HapticevalError, renderer: str, suite: str, case: Case) -> Judged:
    """Return what came of a case whose process is gone: every verdict an error."""
    findings = [_error_finding(error)] * len(case.checks)
    verdicts = verdicts_of_findings(findings, renderer, suite, case, {})
    return Judged(verdicts, recording=None, error=error, refusal=None, simulated_seconds=0.0, wall_seconds=0.0)


def _error_finding(error: HapticevalError) -> Finding:
    return Finding(Outcome.ERROR, "; ".join(part for part in (error.what, error.why) if part))


def verdicts_of_findings(
    findings: Sequence[Finding], renderer: str, suite: str, case: Case, declared: Mapping[str, Any]
) -> tuple[Verdict, ...]:
    """Return findings as verdicts, with what the case publishes of them and who fails alike."""
    verdicts = []
    for check, finding in zip(case.checks, findings, strict=True):
        published = {name: Outcome(outcomes[check]) for name, outcomes in case.published.items() if check in outcomes}
        failing = [name for name, outcome in published.items() if outcome is Outcome.FAIL and name != renderer]
        verdicts.append(
            Verdict(
                renderer=renderer,
                suite=suite,
                case=case.name,
                check=check,
                level=(finding.level or CHECKS[check].level) if case.judged else Level.INFO,
                finding=finding,
                published=published.get(renderer),
                inherent=reason_inherent(check, finding, declared),
                alike=tuple(failing) if finding.outcome is Outcome.FAIL else (),
            )
        )
    return tuple(verdicts)


def finding_of_check(check: str, runs: Runs, scene: Scene) -> Finding:
    """Return a check's finding; a bug in the check is an error of its own and never a failure of the renderer.

    - A check that reads a channel which the recording lacks is undecided.
    - In a run that ended early, since device or law left its domain, what has failed has failed; else it is undecided.
    - A loop that ran away has failed, whatever is asked of it.
    - A failure that has a place says in what region of the model that is, and any whether a standoff was cut.
    """
    ended = runs.base.meta.get("ended")
    try:
        finding = CHECKS[check](runs, scene)
        cut_standoff = note_cut_standoff(runs.base.standoff, scene)
        if finding.outcome is Outcome.FAIL and cut_standoff:
            finding = replace(finding, message=f"{finding.message}; {cut_standoff}")
    except RefusalError as refusal:
        return Finding(Outcome.NOT_APPLICABLE, f"this check cannot be asked here: {refusal.what}, and {refusal.why}")
    except MissingChannelError as missing:
        return without_channel(missing.channel)
    except DomainError as domain_error:
        finding = undecided(f"the run can be had, and what it is compared with cannot: {domain_error.what}")
    except HapticevalError:
        raise
    except Exception as defect:  # the boundary behind which one faulty check must not take the run along
        finding = Finding(Outcome.ERROR, f"the check itself failed: {describe_error(defect)}")
    # Outside of the boundary above: a fault in here is ours, and not the check's.
    finding = with_region(finding, runs.observed(scene))
    # Nothing is to be added where the run went to its end, or where the check could not be asked.
    if ended is None or finding.outcome in (Outcome.NOT_APPLICABLE, Outcome.ERROR):
        return finding
    if ended.get("ran_away"):
        return finding_of_runaway(ended, finding)
    # What has failed before the end has failed. A pass until there is none of the whole run: undecided.
    if finding.outcome is Outcome.FAIL:
        return finding
    evidence = {**finding.evidence, **Facts(ended=dict(ended)).evidence}
    return replace(finding, outcome=Outcome.INCONCLUSIVE, message=describe_end(ended), evidence=evidence)


def with_region(finding: Finding, base: Observed) -> Finding:
    """Add to a failure's evidence the region of the model where it is, if it names a tick of the recording."""
    tick = finding.evidence.get("tick")
    if finding.outcome is not Outcome.FAIL or not isinstance(tick, int) or tick >= len(base):
        return finding
    region = region_of(base, tick)
    place = Facts(region=region.value, nearest_jump_m=nearest_jump(base, tick) if region is Region.MEDIAL else None)
    return replace(finding, evidence={**finding.evidence, **place.evidence})


def _end_by(error: RunawayError) -> dict[str, Any]:
    """Return the end of a run that ran away in its first tick."""
    return {"tick": 0, "time": 0.0, "what": error.what, "why": error.why, "ran_away": True}


def describe_end(ended: Mapping[str, Any]) -> str:
    """Return in words when and why a run ended early."""
    return f"the run ended at t = {ended['time']:.4g} s: {ended['what']}"


def finding_of_runaway(ended: Mapping[str, Any], finding: Finding | None = None) -> Finding:
    """Return the failure of a loop that ran away, with what a check had found until then if that was a failure.

    It weighs as a must, whatever the check: a gate may not let a loop pass for which no other check is asked.
    """
    evidence = {"time": ended["time"], "tick": ended["tick"], **Facts(ended=dict(ended)).evidence}
    if finding is None or finding.outcome is not Outcome.FAIL:
        return Finding(Outcome.FAIL, describe_end(ended), evidence=evidence, level=Level.MUST)
    if finding.facts.ended is not None:  # the check has said so itself
        return replace(finding, level=Level.MUST)
    message = f"{finding.message}; {describe_end(ended)}"
    return replace(finding, message=message, evidence=evidence | dict(finding.evidence), level=Level.MUST)
