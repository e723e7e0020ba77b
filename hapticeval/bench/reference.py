"""What a renderer is measured against: its own projection on the exact curve, or its finest setting, if converged."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, cast

from hapticeval.bench.accuracy import STATISTICS, Answers, Errors, answers, errors
from hapticeval.bench.workload import Workload
from hapticeval.errors import InputError
from hapticeval.knob import Knob, Settings, knobs_of, turned
from hapticeval.renderer import Renderer, RendererFactory

MARGIN = 10.0
"""Refinements of the reference must agree to the tenth of an error for it to be believed."""

ROUNDING = 1e-12
"""Errors below this share of a model's size are rounding."""


@dataclass(frozen=True, eq=False)
class Reference:
    """The answers that errors count from; `disagreement` is how far the last refinement still moved them, 0 if exact.

    `what` says in words which renderer at which settings it is.
    """

    what: str
    answers: Answers
    disagreement: Errors | None

    def claims(self, found: Errors) -> Errors:
        """The errors that can be called demonstrated: none smaller than ten times the disagreement."""
        if self.disagreement is None:
            return found
        return {
            metric: {each: max(value[each], MARGIN * self.disagreement[metric][each]) for each in STATISTICS}
            for metric, value in found.items()
        }

    def proves(self, found: Errors) -> bool:
        """Whether the reference has converged to a tenth of the IHIP errors found."""
        return self.disagreement is None or all(
            found["ihip"][each] >= MARGIN * self.disagreement["ihip"][each] for each in STATISTICS
        )


def on_the_exact_curve(factory: RendererFactory) -> RendererFactory:
    """The same renderer on the exact curve, where it has a choice of representations; else itself."""
    variant = getattr(factory, "variant", None)
    if not callable(variant) or "curve" not in getattr(factory, "representations", ()):
        return factory
    return cast("RendererFactory", variant(representation="curve"))


def reference_of(name: str, factory: RendererFactory, work: Workload) -> Reference | None:
    """The reference of a renderer on a workload; None for one that has neither an exact form nor a knob.

    With knobs the finest setting is the reference and the one before it the check: both are built here.
    """
    exact = on_the_exact_curve(factory)
    knobs = knobs_of(exact)
    if not knobs:
        known = getattr(exact, "representation", None) == "curve"
        return Reference("the exact curve", _asked(exact, work), None) if known else None
    before, last = refinements(knobs)
    coarse, fine = (_asked(cast("Any", turned(exact, each, name=name)), work) for each in (before, last))
    return Reference(
        f"itself at {', '.join(f'{knob} {value:g}' for knob, value in last.items())}",
        fine,
        errors(coarse, fine, stiffness=work.scene.stiffness),
    )


def refinements(knobs: Mapping[str, Knob]) -> tuple[Settings, Settings]:
    """The last but one and the last refinement of all knobs together.

    Raises `InputError` for a knob with one value only: nothing shows then whether it has converged.
    """
    chosen = {name: knob.finest or knob.values for name, knob in knobs.items()}
    for name, values in chosen.items():
        if len(values) < 2:
            raise InputError(
                f"the knob '{name}' has one value only",
                why="a reference without an exact form needs a second, coarser one to show that it has converged",
                todo="give the knob at least two values",
            )
    return {name: values[-2] for name, values in chosen.items()}, {name: values[-1] for name, values in chosen.items()}


def _asked(factory: Callable[..., object], work: Workload) -> Answers:
    return answers(cast("Renderer", factory(work.scene)), work)
