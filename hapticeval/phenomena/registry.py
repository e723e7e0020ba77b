"""All checks by id: the phenomena in the order of thesis section 3.2, what Problem 7.1 asks for, and those of others.

A package adds a check by an entry point of the group `hapticeval.checks`: its name is the check's id, its value a
`Check`.

Ours are the modules of the folder `checks` instead, for looking through the installed packages takes 20 ms of every
process: that is done only for an id that is not ours, and to list all.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from contextlib import suppress
from importlib import import_module
from importlib.metadata import EntryPoint
from pkgutil import iter_modules
from typing import Any

from hapticeval.errors import HapticevalError, InputError, UnknownNameError, describe_error
from hapticeval.phenomena import checks
from hapticeval.phenomena.check import Check
from hapticeval.phenomena.pages import CheckPage, read_page
from hapticeval.phenomena.verdict import kind_of_fault
from hapticeval.registrations import by_name, entries_of

CHECK_GROUP = "hapticeval.checks"

PHENOMENA = (
    "Continuous Contact Point",
    "Contact Normal Force",
    "Broken Contact",
    "Abrupt Switch",
    "Impulsive Collision Force",
    "Centripetal Force",
)
"""The six of thesis section 3.2, in its order."""


def _place_in_lists(check: Check) -> tuple[int, int, int, str]:
    """Return a key of the order in which checks are listed: phenomena, other questions, held surfaces, effects.

    Those of effects stay in the order of their families.
    """
    phenomenon = PHENOMENA.index(check.phenomenon) if check.phenomenon in PHENOMENA else len(PHENOMENA)
    return bool(check.effects), check.holds, phenomenon, "" if check.effects else check.id


def _read_own() -> list[Check]:
    """Return the checks of every module in `hapticeval.phenomena.checks`, in the order of `_place_in_lists`."""
    own: list[Check] = []
    for module in sorted(iter_modules(checks.__path__), key=lambda module: module.name):
        content = vars(import_module(f"{checks.__name__}.{module.name}"))
        own += content["CHECKS"] if "CHECKS" in content else (content["CHECK"],)
    return sorted(own, key=_place_in_lists)


OWN_CHECKS: Mapping[str, Check] = {check.id: check for check in _read_own()}
"""The checks of this package, each of a module of its name, or of that of its family."""

OF_EFFECTS: Mapping[str, Check] = {name: check for name, check in OWN_CHECKS.items() if check.effects}
"""Those that ask whether an effect is shown, which a scene has to call for."""


class Checks(Mapping[str, Check]):
    """Checks by id, ours first. Looking up an installed one that cannot be loaded raises `InputError`."""

    def __getitem__(self, name: str) -> Check:
        # Ours first: the installed packages are looked through for other names only.
        return OWN_CHECKS[name] if name in OWN_CHECKS else _loaded(_installed()[name])

    def __contains__(self, name: object) -> bool:
        return name in OWN_CHECKS or name in _installed()

    def __iter__(self) -> Iterator[str]:
        yield from OWN_CHECKS
        yield from _installed()

    def __len__(self) -> int:
        return len(OWN_CHECKS) + len(_installed())


def _installed() -> Mapping[str, EntryPoint]:
    """Return the entry points of others by name, in alphabetical order; none may replace a check of ours."""
    # An installed check of the name of one of ours is left out: a verdict's meaning is not to be replaced.
    return by_name(entry for entry in entries_of(CHECK_GROUP) if entry.name not in OWN_CHECKS)


def _loaded(entry: EntryPoint) -> Check:
    """Import the check of an entry point; raises `InputError` where that fails or gives something else."""
    try:
        check = entry.load()
    # A package of others may raise anything while it is imported.
    except Exception as error:
        why = describe_error(error)
    else:
        if isinstance(check, Check) and check.id == entry.name:
            read_page(check)  # one that cannot say what it asks is refused before it judges
            return check
        why = f"it is the check '{check.id}'" if isinstance(check, Check) else f"it is a {type(check).__name__}"
    package = "" if entry.dist is None else f" of the package {entry.dist.name}"
    raise InputError(
        f"the check '{entry.name}'{package} cannot be loaded from {entry.value}",
        why=why,
        todo=f"mend or remove that package; an entry point of {CHECK_GROUP} names a Check with its id",
    )


CHECKS: Mapping[str, Check] = Checks()
"""Every check that a suite may name."""


def read_pages() -> Mapping[str, CheckPage]:
    """Return the page of each check by its id; one that is installed and cannot be loaded is left out."""
    pages = {}
    for name in CHECKS:
        with suppress(HapticevalError):
            pages[name] = read_page(CHECKS[name])
    return pages


def item_words(check: str, evidence: Mapping[str, Any]) -> str:
    """Return which item of its check's page a failure with this evidence is about, as "2. A damper acts", or "".

    Where the check tells no kinds of a failure apart, it is the most common one, and the words say so.
    """
    try:
        item = read_page(CHECKS[check]).item_of(evidence)
    except HapticevalError:  # of a package that is no longer installed, or broken
        return ""
    if item is None:
        return ""
    return f"{item.number}. {item.title}" + ("" if kind_of_fault(evidence) else " (the most common cause)")


def checks_called(word: str) -> list[str]:
    """Return the checks that have a word of the field in their ids, or are called so: see `CheckPage.also_called`."""
    return [
        name for name, page in read_pages().items() if any(has_word(text, word) for text in (name, *page.also_called))
    ]


def has_word(text: str, word: str) -> bool:
    """Return whether a text has a word, or some, as words of their own; capitals and hyphens make no difference."""
    plain_text, plain_word = (" ".join(re.findall(r"\w+", part.casefold())) for part in (text, word))
    return bool(plain_word) and f" {plain_word} " in f" {plain_text} "


def unknown_check(name: str) -> UnknownNameError:
    """Return the error for a name of no check; a word of the field tells what is meant better than any spelling."""
    likely_names = " or ".join(checks_called(name))
    return UnknownNameError("check", name, CHECKS, todo=likely_names and f"did you mean {likely_names}?")
