"""What there is to run and to read about, for the command line to show; each list imports what it needs."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import chain
from types import MappingProxyType
from typing import TYPE_CHECKING

from hapticeval.commands.terminal import columns, lines, paragraphs
from hapticeval.errors import HapticevalError, InputError, UnknownNameError
from hapticeval.quantity import plural
from hapticeval.suite.outline import Heading, find_suites, outline, suite_groups, suites_named

if TYPE_CHECKING:
    from hapticeval.phenomena.check import Check

Rows = Iterator[tuple[str, str]]
"""Names, each with a text beside it."""


def renderers() -> Rows:
    """Every renderer that is installed, and the suffixes that it takes; a broken one says why. Then what any takes."""
    from hapticeval.discovery import known_modifiers, known_renderers, resolve
    from hapticeval.renderer import choices_of

    for name in known_renderers():
        try:
            # Imports the renderer, which may fail for a package of someone else's.
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
    for name, entry in known_modifiers().items():
        yield f"+{name}", f"behind any of these: {_first_sentence(entry.load())}"


def suites() -> Rows:
    """The built-in suites, and the groups of them that one name runs."""
    for name, file in find_suites().items():
        suite = outline(file)
        yield f"{name} {suite.version}", f"{suite.title} ({len(suite.cases)} cases; {suite.citation})"
    for name, members in suite_groups().items():
        yield name, f"all of {', '.join(members)}"


def cases(named: Sequence[str] = ()) -> Iterator[tuple[str, Rows]]:
    """The suites of those names, groups or files, all that are installed if none are named, each with its cases.

    Raises as `suites_named` and `load_suite` do.
    """
    installed = find_suites()
    # A suite that several groups have is listed once.
    for name in dict.fromkeys(member for name_or_group in named or installed for member in suites_named(name_or_group)):
        outlined = outline(installed[name]).cases if name in installed else _cases_in_file(name)
        yield (
            name,
            ((heading.name, heading.title + ("" if judged else " (not judged)")) for heading, judged in outlined),
        )


def _cases_in_file(file: str) -> Sequence[tuple[Heading, bool]]:
    # Imported for a user's file alone: it takes what compiles.
    from hapticeval.suite.reading import load_suite

    return [(Heading(case.name, case.title), case.judged) for case in load_suite(file).cases]


def checks() -> Rows:
    """The checks that are installed, each with what it asks; a broken one says why."""
    from hapticeval.phenomena.pages import read_page
    from hapticeval.phenomena.registry import CHECKS

    for name in CHECKS:
        try:
            yield name, read_page(CHECKS[name]).question
        except HapticevalError as error:
            yield name, f"broken: {error.why}"


def devices() -> Rows:
    """The devices, each with its parameters."""
    from hapticeval.devices.catalogue import DEVICES

    return _catalogue_rows(DEVICES)


def models() -> Rows:
    """The models, each with its parameters."""
    from hapticeval.geometry.catalogue import MODELS

    return _catalogue_rows(MODELS)


def effects() -> Rows:
    """What a scene may call for, each with its numbers, in the order in which effects take part in a tick."""
    from hapticeval.effects.catalogue import EFFECTS

    # The entry's factory has the docstring and the parameters.
    return _catalogue_rows({kind: entry.of for kind, entry in EFFECTS.items()})


def formats() -> Rows:
    """The file formats that are read, each with its name for `--format`; also those of other packages."""
    from hapticeval.recordings import formats as known

    return ((format_.name, format_.about) for format_ in known.formats().values())


def _catalogue_rows(catalogue: Mapping[str, Callable[..., object]]) -> Rows:
    """Yield each entry's name and first sentence, and below it the parameters that it takes."""
    for name, factory in catalogue.items():
        yield name, _first_sentence(factory)
        parameters = [_parameter_text(parameter) for parameter in inspect.signature(factory).parameters.values()]
        if parameters:
            yield "", f"takes {', '.join(parameters)}"


def _parameter_text(parameter: inspect.Parameter) -> str:
    """Return a parameter as it is written on the command line, with its default if it has one."""
    # **parameters of a family: any number of entries.
    if parameter.kind is parameter.VAR_KEYWORD:
        return parameter.name
    return parameter.name if parameter.default is parameter.empty else f"{parameter.name}={parameter.default}"


LISTINGS: Mapping[str, Callable[[], Rows]] = MappingProxyType(
    {listing.__name__: listing for listing in (renderers, suites, checks, devices, models, effects, formats)}
)
"""What can be listed beside the cases, by name."""


def listing_text(what: str, named: Sequence[str] = ()) -> str:
    """Return all that there is of one kind, of the cases those of the suites that are `named`, for a terminal.

    Raises `UnknownNameError` for what cannot be listed, and `InputError` for names of what is in no suites.
    """
    # Cases alone take names of suites.
    if what == cases.__name__:
        return paragraphs(
            *(lines([suite, columns((f"  {name}", text) for name, text in rows)]) for suite, rows in cases(named))
        )
    if what not in LISTINGS:
        raise UnknownNameError("listing", what, [*LISTINGS, cases.__name__])
    if named:
        raise InputError(
            f"{what} are of no suite, and '{named[0]}' is left over",
            todo=f"write hapticeval list {what}, or list cases SUITE",
        )
    return columns(LISTINGS[what]())


def explanation(word: str) -> str:
    """Return what is asked first of a check by its id or by a word of the field for it, as `pop-through`.

    Where several checks have that word in their ids or are called so, or their pages use it, it lists those. A number
    of the thesis, as 6.22, table-6.3 or (4.12), is explained by what shows it. Raises `UnknownNameError` for a word of
    none, and `InputError` for what is not a check, but a renderer, a case or the like.
    """
    from hapticeval.phenomena.registry import CHECKS, checks_called, has_word, read_pages
    from hapticeval.study.thesis.printed import PLACE

    if word in CHECKS:
        return _check_text(CHECKS[word])
    if PLACE.fullmatch(word):
        return paragraphs(*map(columns, place_parts(word)))
    called = checks_called(word)
    if len(called) == 1:
        return _check_text(CHECKS[called[0]])
    pages = read_pages()
    named = called or [name for name, page in pages.items() if has_word(page.text, word)]
    if not named:
        case_rows = chain.from_iterable(rows for _, rows in cases())
        for what, rows in (*((what, listed()) for what, listed in LISTINGS.items()), (cases.__name__, case_rows)):
            if word in (name for name, _ in rows):
                raise InputError(
                    f"'{word}' is not a check", why=f"it is among the {what}", todo=f"see hapticeval list {what}"
                )
        raise UnknownNameError(
            "check", word, {*CHECKS, *(text for page in pages.values() for text in page.also_called)}
        )
    where = "in what others call" if called else "on the pages of"
    return paragraphs(
        f"'{word}' is {where} {plural(len(named), 'check')}; hapticeval explain CHECK has more:",
        columns((name, pages[name].question) for name in named),
    )


def place_parts(name: str) -> Iterator[Rows]:
    """Yield the rows of each item of the thesis that a name means, and the checks that cite it.

    Raises as `items_named`.
    """
    from hapticeval.phenomena.registry import CHECKS
    from hapticeval.study.thesis.printed import PLACE, items_named, slug_of

    for place, item in items_named(name).items():
        yield chain(
            [(place, item.title)],
            [("not computed", item.not_computed)] if item.not_computed else [],
            [("shown by", source) for source in (*item.drawn_cases, *item.studies, *filter(None, [item.suite]))],
            [("claim", f"{claim.says} ({claim.in_print})") for claim in item.claims],
            [("compute it", f"hapticeval reproduce {slug_of(place)}")] if not item.not_computed or item.claims else [],
        )
    match = PLACE.fullmatch(name)
    assert match is not None, "items_named refuses it"
    # As "6.22", not within "6.220" or "16.22".
    cited = re.compile(rf"(?<![\d.]){re.escape(match[2])}(?![\d.])")
    checks_citing = [check.id for check in CHECKS.values() if cited.search(check.citation)]
    if checks_citing:
        yield iter([("checks that cite it", ", ".join(checks_citing))])


def _check_text(check: Check) -> str:
    """Return what is asked first of a check: a screen of 24 lines."""
    from hapticeval.phenomena.pages import page_file

    # A check of another package brings its page along, and not as a file.
    more = "" if check.page else f", more in {page_file(check)}"
    return lines([f"{check.id} ({check.level.value}){more}", columns(check_rows(check))])


def check_rows(check: Check) -> Rows:
    """Yield what is asked first of a check; its page has the rest."""
    from hapticeval.phenomena.inherent import declaration_words, limits_of
    from hapticeval.phenomena.pages import read_page

    page = read_page(check)
    yield "asks", page.question
    if page.also_called:
        yield "also called", ", ".join(page.also_called)
    yield "formula", check.formula
    yield "metric", f"{check.metric} ({check.unit or 'a ratio'})"
    yield "bound", page.bound
    if page.items:
        yield "if it fails", "; ".join(f"{item.number}. {item.title}" for item in page.items)
    for declared, because in limits_of(check.id).items():
        yield "inherent", f"in {declaration_words(declared).removeprefix('declares = ')}: {because}"
    also = f"; where recorded: {', '.join(check.reads_also)}" if check.reads_also else ""
    yield "reads", ", ".join(check.channels) + also
    if check.siblings:
        yield "also runs", "; ".join(check.siblings.values())
    if check.needs:
        yield "needs", "; ".join(check.siblings[sibling] for sibling in check.needs)
    if check.not_for:
        yield "not for", "; ".join(check.not_for)
    if check.effects:
        yield "only with", "an effect of the surface: " + ", ".join(check.effects)
    if check.not_with:
        yield "not with", "an effect that makes " + ", or ".join(check.not_with)
    yield "source", check.citation


def _first_sentence(factory: object) -> str:
    return " ".join((factory.__doc__ or "").split()).partition(". ")[0].rstrip(".") + "."
