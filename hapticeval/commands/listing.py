"""What there is to run and to read about: pairs of a name and a text, for the command line to show."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from types import MappingProxyType

from hapticeval.devices.catalogue import DEVICES
from hapticeval.discovery import known_renderers, resolve
from hapticeval.errors import HapticevalError, UnknownNameError
from hapticeval.geometry.catalogue import MODELS
from hapticeval.phenomena.registry import CHECKS
from hapticeval.renderer import choices_of
from hapticeval.suite.installed import find_suites, suite_groups
from hapticeval.suite.reading import load_suite


def renderers() -> Iterator[tuple[str, str]]:
    """Every renderer that is installed, and the suffixes that it takes; a broken one says why."""
    for name in known_renderers():
        try:
            offered = choices_of(resolve(name))
        except HapticevalError as error:
            yield name, f"broken: {error.why}"
            continue
        yield name, offered.summary
        choices = [
            f"{sign}{choice}"
            for sign, offer in (("+", offered.regulations), ("@", offered.representations))
            for choice in offer or ()
        ]
        if choices:
            yield "", f"takes {' '.join(choices)}"


def suites() -> Iterator[tuple[str, str]]:
    """The built-in suites, and the groups of them that one name runs."""
    for name in find_suites():
        suite = load_suite(name)
        yield name, f"{suite.title} ({len(suite.cases)} cases; {suite.citation})"
    for name, members in suite_groups().items():
        yield name, f"all of {', '.join(members)}"


def cases() -> Iterator[tuple[str, str]]:
    """The cases of the built-in suites."""
    for name in find_suites():
        for case in load_suite(name).cases:
            judged = "" if case.judged else "; shown, not judged"
            yield f"{name}/{case.name}", f"{case.title} ({case.stimulus_kind}{judged})"


def checks() -> Iterator[tuple[str, str]]:
    """The checks that are installed, each with what it asks; a broken one says why."""
    for name in CHECKS:
        try:
            yield name, CHECKS[name].asks
        except HapticevalError as error:
            yield name, f"broken: {error.why}"


def made(catalogue: Mapping[str, Callable[..., object]]) -> Iterator[tuple[str, str]]:
    """A catalogue of factories, each with its parameters."""
    for name, factory in catalogue.items():
        yield name, _first_sentence(factory)
        given = [_parameter(each) for each in inspect.signature(factory).parameters.values()]
        if given:
            yield "", f"takes {', '.join(given)}"


def _parameter(parameter: inspect.Parameter) -> str:
    if parameter.kind is parameter.VAR_KEYWORD:
        return parameter.name
    return parameter.name if parameter.default is parameter.empty else f"{parameter.name}={parameter.default}"


LISTINGS: Mapping[str, Callable[[], Iterator[tuple[str, str]]]] = MappingProxyType(
    {
        **{each.__name__: each for each in (renderers, suites, cases, checks)},
        "devices": partial(made, DEVICES),
        "models": partial(made, MODELS),
    }
)
"""What can be listed, by name."""


def listed(what: str) -> Iterator[tuple[str, str]]:
    """All that there is of one kind. Raises `UnknownNameError` for what is none of `LISTINGS`."""
    if what not in LISTINGS:
        raise UnknownNameError("listing", what, LISTINGS)
    return LISTINGS[what]()


def explained(name: str) -> Iterator[tuple[str, str]]:
    """All that a check says of itself. Raises `UnknownNameError` for an id that is none."""
    if name not in CHECKS:
        raise UnknownNameError("check", name, CHECKS)
    check = CHECKS[name]
    yield check.id, check.asks
    yield "phenomenon", check.phenomenon
    yield "formula", check.formula
    yield "metric", f"{check.metric} ({check.unit or 'a ratio, without a unit'})"
    yield "bound", check.bound
    yield "level", check.level.value
    yield "reads", ", ".join([*check.channels, *(f"{channel} where it was recorded" for channel in check.reads_also)])
    yield "also runs", "; ".join(check.siblings.values()) or "none"
    if check.needs:
        yield "needs", "; ".join(check.siblings[sibling] for sibling in check.needs)
    if check.not_for:
        yield "not for", "; ".join(check.not_for)
    if check.effects:
        yield "only with", "an effect of the surface: " + ", ".join(check.effects)
    if check.not_with:
        yield "not with", "an effect of the surface: " + ", ".join(check.not_with)
    yield "source", check.citation


def _first_sentence(factory: object) -> str:
    return " ".join((factory.__doc__ or "").split()).partition(". ")[0].rstrip(".") + "."
