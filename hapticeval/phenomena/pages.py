"""The page of each check, `docs/checks/ID.md`: the prose that terminal, report and site show of a check.

A page begins with the question. `## Also called`, where it is there, has the field's words for what fails the check,
with commas between them. `## Bound` gives the bound in a few lines, then its derivation as a list;
`## What it does not see` names the other check to ask; `## When it fails` lists causes, the most common first.

The formula, the level and the channels stand in the check itself, and the site draws the pictures.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from importlib.resources.abc import Traversable
from itertools import pairwise
from typing import TYPE_CHECKING

from hapticeval.errors import InputError

if TYPE_CHECKING:
    from markdown_it.token import Token

    from hapticeval.phenomena.check import Check

ALSO_CALLED = "Also called"
BOUND = "Bound"
WHEN_IT_FAILS = "When it fails"


@dataclass(frozen=True)
class CheckPage:
    """What others print of a page, as plain text: the question, the bound without its derivation, and the first cause.

    `also_called` are the field's words for what fails it. `first_cause` is empty where the page lists none. `text` is
    the whole page, in Markdown.
    """

    question: str
    bound: str
    first_cause: str
    text: str
    also_called: tuple[str, ...]


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
    return CheckPage(question, bound, _first_item(sections.get(WHEN_IT_FAILS, ())), text, also_called)


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


def _first_item(tokens: Sequence[Token]) -> str:
    """Return the first item of the first list of a section; empty without a list."""
    in_list = False
    for token in tokens:
        in_list = in_list or token.type.endswith("list_open")
        if in_list and token.type == "inline":
            return _plain(token)
    return ""


def _plain(inline: Token) -> str:
    """Return the words of an inline token, without emphasis and links, on one line."""
    words = (" " if child.type.endswith("break") else child.content for child in inline.children or ())
    return "".join(words)
