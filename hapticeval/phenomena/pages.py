"""The page of each check, `docs/checks/ID.md`: the prose that terminal, report and site show of a check.

A page begins with the question. `## Also called`, where it is there, has the field's words for what fails the check,
with commas between them. `## Bound` gives the bound in a few lines, then its derivation as a list;
`## What it does not see` names the other check to ask; `## When it fails` lists causes, the most common first, each
with its title in bold. A comment in an item, `<!-- lag, low-pass -->`, has the kinds of findings that it is about: a
verdict of such a kind names that item.

The formula, the level and the channels stand in the check itself, and the site draws the pictures.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from importlib.resources.abc import Traversable
from itertools import pairwise
from typing import TYPE_CHECKING, Any

from hapticeval.errors import InputError
from hapticeval.phenomena.verdict import kind_of_fault

if TYPE_CHECKING:
    from markdown_it.token import Token

    from hapticeval.phenomena.check import Check

ALSO_CALLED = "Also called"
BOUND = "Bound"
WHEN_IT_FAILS = "When it fails"


@dataclass(frozen=True)
class PageItem:
    """A cause of a fail on a page: its number there, its title, what to do, and the `kinds` of findings it is about."""

    number: int
    title: str
    text: str
    kinds: tuple[str, ...]


@dataclass(frozen=True)
class CheckPage:
    """What others print of a page, as plain text: the question, the bound without its derivation, and the causes.

    `also_called` are the field's words for what fails it. `items` are the causes of a fail, none where the page lists
    none. `text` is the whole page, in Markdown.
    """

    question: str
    bound: str
    items: tuple[PageItem, ...]
    text: str
    also_called: tuple[str, ...]

    def item_of(self, evidence: Mapping[str, Any]) -> PageItem | None:
        """Return the item that a failure with this evidence is about, None where no item has its kind.

        Of a kind as "gain at depths" that of the longest beginning, "gain at depths" before "gain". The first one,
        which is the most common cause, where the check tells no kinds apart.
        """
        kind = kind_of_fault(evidence)
        if not kind:
            return self.items[0] if self.items else None
        beginnings = [
            (len(name), item) for item in self.items for name in item.kinds if f"{kind} ".startswith(f"{name} ")
        ]
        return max(beginnings, key=lambda pair: pair[0])[1] if beginnings else None


def page_file(check: Check) -> Traversable:
    """Return the file of the page of a check of this package."""
    return files("hapticeval.check_pages") / f"{check.id}.md"


def read_page(check: Check) -> CheckPage:
    """Return the page of a check: the one that it brings, or that of this package.

    Raises `InputError` where it has none, or one without a question or a bound.
    """
    try:
        # A check of another package brings its own page.
        return parse_page(check.page or page_file(check).read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(
            f"the check '{check.id}' has no page that can be read",
            why=str(error),
            todo=f"give it a page=... in Markdown: '# {check.id}', its question, '## {BOUND}' and what is allowed",
        ) from error


@cache
def parse_page(text: str) -> CheckPage:
    """Return the parts of a page in Markdown; raises `ValueError` where it has no question or no bound."""
    from markdown_it import MarkdownIt

    sections = dict(_sections(MarkdownIt().parse(text)))
    question, bound = _paragraphs(sections[""]), _paragraphs(sections.get(BOUND, ()))
    if not question or not bound:
        raise ValueError(f"a check's page begins with its question, and has a paragraph below '## {BOUND}'")
    also_called = tuple(filter(None, _paragraphs(sections.get(ALSO_CALLED, ())).split(", ")))
    return CheckPage(question, bound, tuple(_items(sections.get(WHEN_IT_FAILS, ()))), text, also_called)


def _sections(tokens: Sequence[Token]) -> Iterator[tuple[str, Sequence[Token]]]:
    """Yield each section below a heading of the second level by its title, and what comes before the first by ''."""
    starts = [index for index, token in enumerate(tokens) if token.type == "heading_open" and token.tag == "h2"]
    yield "", tokens[: starts[0] if starts else len(tokens)]
    # The title is the inline token behind the heading's opening.
    for start, end in pairwise([*starts, len(tokens)]):
        yield _plain(tokens[start + 1]), tokens[start + 2 : end]


def _paragraphs(tokens: Sequence[Token]) -> str:
    """Return the paragraphs before the first list of a section, without its heading."""
    texts = []
    for before, token in pairwise(tokens):
        # The derivation is a list: the bound itself ends where that begins.
        if before.type.endswith("list_open"):
            break
        if before.type == "paragraph_open":
            texts.append(_plain(token))
    return " ".join(texts)


def _items(tokens: Sequence[Token]) -> Iterator[PageItem]:
    """Yield the items of the lists of a section, in their order."""
    number = 0
    for before, token in pairwise(tokens):
        # The first paragraph of an item; others of it follow a paragraph.
        if token.type == "paragraph_open" and before.type == "list_item_open":
            number += 1
        elif token.type == "inline" and number:
            children = token.children or ()
            bold = [index for index, child in enumerate(children) if child.type in ("strong_open", "strong_close")]
            text = _plain(token)
            title = _words(children[bold[0] : bold[1]]) if bold else text.partition(". ")[0]
            comments = (child.content.strip("<!-> ") for child in children if child.type == "html_inline")
            kinds = (kind.strip() for comment in comments for kind in comment.split(","))
            yield PageItem(number, title.rstrip(".,:"), text, tuple(kinds))


def _plain(inline: Token) -> str:
    """Return the words of an inline token, without emphasis and links, on one line."""
    return _words(inline.children or ())


def _words(children: Sequence[Token]) -> str:
    texts = (
        " " if child.type.endswith("break") else child.content for child in children if child.type != "html_inline"
    )
    return "".join(texts).strip()
