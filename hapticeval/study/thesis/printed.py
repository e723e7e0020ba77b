"""What the thesis shows, in its order, with what the print says of each figure, table and experiment: `items.toml`."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from msgspec import Struct, field

from hapticeval.documents import convert, read_toml
from hapticeval.errors import UnknownNameError
from hapticeval.quantity import format_number

ITEMS_FILE = Path(__file__).with_name("items.toml")

CLAIM_UNITS: Mapping[str, float] = {
    "": 1.0, "rad": 1.0, "°": math.pi / 180.0, "m/s": 1.0, "m/s²": 1.0, "N": 1.0, "N/m": 1.0, "N m": 1.0,
    "mm": 1e-3, "s": 1.0, "ms": 1e-3, "%": 1e-2, "kHz": 1e3, "MB": 1e6, "GB": 1e9,
}  # fmt: skip
"""Units of claims, in those that measures have."""


class Claim(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What the print says, and what decides whether it comes out.

    - `check` of the case gives `outcome`; or `measure`, with `options`, gives the `value` in print; or so does `entry`
      of the document that the item's study of that number writes
    - `value`: a number as it is printed, compared to its last digit; "> 5" or "< 5" where none is printed
    - `of`: the renderer, else the item's first; `case` where it is not the item's; `why`: the reason of a difference
    """

    says: str
    check: str = ""
    outcome: str = ""
    measure: str = ""
    options: dict[str, Any] = field(default_factory=dict)
    study: int = 1
    entry: str = ""
    value: str = ""
    unit: str = ""
    of: str = ""
    case: str = ""
    why: str = ""

    @property
    def in_print(self) -> str:
        """What is in print, or what is asked where no number is."""
        return f"{self.check}: {self.outcome}" if self.check else f"{self.value} {self.unit}".strip()

    def compare(self, measured: float) -> Comparison:
        """Compare a number in SI units with the print."""
        ours = measured / CLAIM_UNITS[self.unit]
        sign, _, number = self.value.rpartition(" ")
        printed = float(number)
        # Half a unit of the last digit: "2.4e-5" has one of 1e-6.
        mantissa, _, power = number.partition("e")
        half = 0.5 * 10.0 ** (int(power or 0) - len(mantissa.partition(".")[2]))
        agrees = {">": ours > printed, "<": ours < printed, "": abs(ours - printed) <= half * (1.0 + 1e-9)}[sign]
        text, difference = (f"{format_number(number)} {self.unit}".rstrip() for number in (ours, ours - printed))
        return Comparison(claim=self, agrees=agrees, ours=text, difference="" if sign else difference)


class Item(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Something that the thesis numbers: what shows it here, and its claims. `not_computed`: what it is instead."""

    title: str
    section: str = ""
    equations: str = ""
    not_computed: str = ""
    case: str = ""
    cases: tuple[str, ...] = ()
    renderers: tuple[str, ...] = ()
    each: tuple[str, ...] = ()
    together: tuple[str, ...] = ()
    studies: tuple[str, ...] = ()
    suite: str = ""
    model: str = ""
    outlines: tuple[str, ...] = ()
    depths: tuple[float, ...] = ()
    grid: str = ""
    claims: tuple[Claim, ...] = ()

    @property
    def drawn_cases(self) -> Sequence[str]:
        """The cases whose runs are drawn."""
        return (self.cases or (self.case,)) if self.each or self.together else ()

    def renderer_of(self, claim: Claim) -> str:
        """Return the renderer that a claim is about; empty for one about no run."""
        return full_name(claim.of or next(iter(self.renderers), ""))

    def runs(self) -> Iterator[tuple[str, str, str]]:
        """Yield case, renderer and check for all that has to run; without a check the recording is needed."""
        for case in self.drawn_cases:
            yield from ((case, full_name(renderer), "") for renderer in self.renderers)
        for claim in self.claims:
            case, renderer = claim.case or self.case, self.renderer_of(claim)
            if case and renderer and (claim.check or claim.measure):
                yield case, renderer, claim.check
            if "from" in claim.options:
                yield case, full_name(claim.options["from"]), ""


class Comparison(Struct, frozen=True, kw_only=True):
    """What came of a claim: `ours`, the `difference` from a number in print, and whether they agree."""

    claim: Claim
    agrees: bool
    ours: str
    difference: str = ""

    @property
    def explained(self) -> bool:
        """Whether it agrees, or a reason is given why not."""
        return self.agrees or bool(self.claim.why)

    @property
    def words(self) -> str:
        """Ours, what is in print, the difference and its reason, in a line."""
        word = "asked" if self.claim.value[:1] in ("<", ">") else "in print"
        parts = [f"{word} {self.claim.in_print}"]
        if not self.agrees:
            if self.difference:
                parts.append(f"differs by {self.difference}")
            parts.append(self.claim.why or "no reason is known")
        return f"{self.claim.says}: {self.ours} ({'; '.join(parts)})"


class Part(NamedTuple):
    """An item of the thesis as it came out, with the texts of its studies and what was found of its claims."""

    name: str
    item: Item
    pictures: Sequence[Path]
    texts: Sequence[str]
    comparisons: Sequence[Comparison]


@cache
def read_items() -> Mapping[str, Item]:
    """Return all items by their names, in the order of the thesis."""
    items: dict[str, Item] = convert(read_toml(ITEMS_FILE)["items"], dict[str, Item], ITEMS_FILE.name)
    return items


def full_name(renderer: str) -> str:
    """Return the renderer that an item means: a scheme alone, as "+pp", is one of minimum distance."""
    return f"minimum-distance{renderer}" if renderer.startswith("+") else renderer


PRINTED_NUMBER = r"[2-8A]\.\d+"
PLACE = re.compile(
    rf"\(?(?:(figure|table|section|problem|equation|chapter)[- ])?({PRINTED_NUMBER}|[2-8A])\)?", re.IGNORECASE
)
"""What names a part of the thesis: figure-6.22, table-6.3, 6.22, "(4.12)", chapter-6."""


def numbers_of(words: str) -> set[str]:
    """Return the numbers that words such as "Figures 7.6 to 7.8", "5.14, 5.15" or "Table A.1" name."""
    numbers: set[str] = set()
    for first, last in re.findall(rf"({PRINTED_NUMBER})(?: to ({PRINTED_NUMBER}))?", words):
        chapter, _, begin = first.partition(".")
        numbers |= {f"{chapter}.{number}" for number in range(int(begin), int(last.partition(".")[2] or begin) + 1)}
    return numbers


def items_named(name: str) -> Mapping[str, Item]:
    """Return the items that a name means: one of `PLACE`, or `all`. Raises `UnknownNameError` for what is none."""
    items, match = read_items(), PLACE.fullmatch(name)
    kind, number = ((match[1] or "").lower(), match[2].upper()) if match else ("", name)
    if name.startswith("("):
        kind = "equation"
    chosen = {
        place: item
        for place, item in items.items()
        if name == "all"
        or (kind in ("", "chapter") and chapter_of(place) == number)
        or (kind == "equation" and number in numbers_of(item.equations))
        or (place.lower().startswith(kind) and number in numbers_of(place))
    }
    if not chosen:
        # "Figures 6.2 and 6.3" is meant by figure-6.2 and by figure-6.3.
        known = [f"{slug_of(place).partition('-')[0]}-{k}" for place in items for k in numbers_of(place)]
        raise UnknownNameError("part of the thesis", name, [*known, "chapter-6", "all"])
    return chosen


def chapter_of(name: str) -> str:
    """Return the chapter of an item: "6" of "Figure 6.22"."""
    number: str = re.findall(PRINTED_NUMBER, name)[0]
    return number.partition(".")[0]


def slug_of(name: str) -> str:
    """Return the name of an item for the command, a file or an anchor, by its first number: "figure-6.22"."""
    kind = name.partition(" ")[0].lower().rstrip("s")
    return f"{kind}-{re.findall(PRINTED_NUMBER, name)[0].lower()}"
