"""What a check says: the outcome, the measured metric, the bound, and where to look."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from enum import StrEnum
from typing import Any


class Outcome(StrEnum):
    """How a check ended."""

    PASS = "pass"
    FAIL = "fail"
    INCONCLUSIVE = "inconclusive"
    NOT_APPLICABLE = "not-applicable"
    ERROR = "error"


class Level(StrEnum):
    """How much a check weighs: `must` decides the exit code, `should` warns, `info` is shown."""

    MUST = "must"
    SHOULD = "should"
    INFO = "info"


@dataclass(frozen=True)
class Metric:
    """A measured number with its name and unit."""

    name: str
    value: float
    unit: str


@dataclass(frozen=True)
class Finding:
    """What a check found in one run: the verdict without the names of renderer, suite, case and check.

    `bound` has the metric's unit, and a metric up to it passes. `evidence` says where and when: `time` (s), `hip` and
    `ihip` (m) where they make sense, and what else the check measured, as plain JSON values.

    `message` is one sentence for a person. `level` is the weight of this finding where it is not the check's own.
    """

    outcome: Outcome
    message: str
    metric: Metric | None = None
    bound: float | None = None
    evidence: Mapping[str, Any] = field(default_factory=dict)
    level: Level | None = None

    @property
    def facts(self) -> Facts:
        """What others read of the evidence."""
        return Facts.of(self.evidence)

    @property
    def margin(self) -> float | None:
        """Bound less metric, in the metric's unit: negative is a failure."""
        if self.metric is None or self.bound is None:
            return None
        return self.bound - self.metric.value


@dataclass(frozen=True, kw_only=True)
class Facts:
    """What others read of a failure's evidence: by these it is excused, and told from other faults of its check.

    A check states them, and `evidence` are its entries; `of` reads them back, of a stored verdict too. None is what the
    check does not say.

    - A collision: what the first ticks took of the momentum, N s, what (3.5) asks for, and what the declared spring
      gives at the depths of these ticks; when the tool stops, ms, of one that does; whether one that leaves before was
      pressed as the declared spring asks up to there.
    - `force_over_spring`: a force that is off the declared spring, as a multiple of it.
    - `deepest_m`: how deep the hand gets without contact, m.
    - `off_surface_m`, `unexplained_jump_m`: an IHIP off the surface, and a jump that the nearest point does not make.
    - `severity`, `kind`: which of the check's faults it is, such as a mini pop-through, or a contact let go.
    - `region` of the model where it is, and how far the model's nearest point jumps there, m.
    - `ended`: what ended the run early.
    """

    impulse_wanted_Ns: float | None = None
    impulse_in_window_Ns: float | None = None
    spring_impulse_Ns: float | None = None
    stopped_after_ms: float | None = None
    pressed_until_left: bool | None = None
    force_over_spring: float | None = None
    deepest_m: float | None = None
    off_surface_m: float | None = None
    unexplained_jump_m: float | None = None
    severity: str | None = None
    kind: str | None = None
    region: str | None = None
    nearest_jump_m: float | None = None
    ended: Mapping[str, Any] | None = None

    @classmethod
    def of(cls, evidence: Mapping[str, Any]) -> Facts:
        """Return what evidence says."""
        names = [fact.name for fact in fields(cls)]
        return cls(**{name: evidence[name] for name in names if evidence.get(name) is not None})

    @property
    def evidence(self) -> dict[str, object]:
        """What is stated, as entries of evidence."""
        return {name: value for name, value in vars(self).items() if value is not None}

    @property
    def fault(self) -> str:
        """Which of the faults that a check tells apart this is; "" of none."""
        return self.severity or self.kind or ""


def kind_of_fault(evidence: Mapping[str, Any]) -> str:
    """Return which kind of fault a failure's evidence states: its cause, or which of its check's faults it is; else "".

    "unexplained" stands for a cause that nobody knows.
    """
    cause, fault = str(evidence.get("cause", "")), Facts.of(evidence).fault
    return fault if cause in ("unexplained", "none") and fault else cause or fault


def not_applicable(message: str) -> Finding:
    """Return the finding of a check that has no question here."""
    return Finding(Outcome.NOT_APPLICABLE, message)


def shown_only(finding: Finding, active: str) -> Finding:
    """Return a finding that asks nothing, since an effect is `active`: why, in words, in the evidence as a whole."""
    message = f"{finding.message}; shown only, for {active.partition(':')[0]}"
    evidence = {**finding.evidence, "shown_only_for": active}
    return replace(finding, level=Level.INFO, message=message, evidence=evidence)


def undecided(
    message: str, metric: Metric | None = None, bound: float | None = None, evidence: Mapping[str, Any] | None = None
) -> Finding:
    """Return the finding of a check that the recording does not let decide."""
    return Finding(Outcome.INCONCLUSIVE, message, metric, bound, evidence or {})


def compared(metric: Metric, bound: float, evidence: Mapping[str, Any], *, passes: str, fails: str) -> Finding:
    """Return the finding of a check that passes up to `bound` and fails beyond, with the message for either."""
    # On the bound passes; a metric that is not a number is on neither side, and fails.
    passed = metric.value <= bound
    return Finding(Outcome.PASS if passed else Outcome.FAIL, passes if passed else fails, metric, bound, evidence)


UNSATISFIED = (Outcome.FAIL, Outcome.INCONCLUSIVE)
"""What stops a gate at level `must`, and warns at level `should`."""


@dataclass(frozen=True)
class Verdict:
    """A finding with its identity, its weight, and the published outcome where the suite carries one.

    `inherent` is why a failure follows from what the renderer declares, see `hapticeval.phenomena.inherent`. `alike`
    are other renderers that the suite has failing here as well.
    """

    renderer: str
    suite: str
    case: str
    check: str
    level: Level
    finding: Finding
    published: Outcome | None = None
    inherent: str = ""
    alike: tuple[str, ...] = ()

    @property
    def outcome(self) -> Outcome:
        """How the check ended."""
        return self.finding.outcome

    @property
    def as_expected(self) -> bool:
        """Whether the outcome is nothing that stops a gate, and does not differ from a published one.

        An error stops it, and at level `must` so do a failed check and one that could not decide: a renderer that never
        touches the surface has not passed. What is inherent does not. That a failure is in print does not excuse it.
        """
        if self.published is not None and self.outcome is not self.published:
            return False
        if self.outcome is Outcome.ERROR:
            return False
        return not (self.outcome in UNSATISFIED and self.level is Level.MUST) or bool(self.inherent)
