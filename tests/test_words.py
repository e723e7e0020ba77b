"""The taste of what people read: sentences of 20 words on average and 40 at most, in pages and in messages."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path
from statistics import mean

ROOT = Path(__file__).parents[1]
CHECKS = sorted((ROOT / "docs" / "checks").glob("*.md"))
PAGES = [*sorted(ROOT.glob("*.md")), *sorted((ROOT / "docs").rglob("*.md"))]
SOURCES = [path for folder in ("hapticeval", "reports", "renderers") for path in sorted((ROOT / folder).rglob("*.py"))]
AVERAGE, LONGEST = 20.0, 40
"""Words of a sentence: on average over all pages, and of any one."""

FENCE = re.compile(r"^```.*?^```$", re.MULTILINE | re.DOTALL)
ITEM = re.compile(r"\n(?=\s*(?:[-*]|\d+\.) |#|\|)")
END = re.compile(r"(?<=[\w)`*%²][.!?])[\"”)*]*\s+(?=\S)")


def sentences(text: str) -> Iterator[str]:
    """Yield the sentences of a page in Markdown, without code, tables and headings; code within a line is one word."""
    for paragraph in re.split(r"\n\s*\n", FENCE.sub("", text)):
        if paragraph.startswith("    "):
            continue
        for item in ITEM.split(paragraph):
            if item.lstrip().startswith(("|", "#")):
                continue
            words = re.sub(r"`[^`]*`", "`code`", re.sub(r"!?\[([^]]*)\]\([^)]*\)", r"\1", item))
            yield from END.split(" ".join(words.split()))


def count_words(sentence: str) -> int:
    """Return how many words a sentence has: what holds a letter or a digit."""
    return sum(bool(re.search(r"\w", word)) for word in sentence.split())


def messages(source: str) -> Iterator[str]:
    """Yield the texts of errors in a module: all that is given to what is called ...Error; a value is one word."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Call) and getattr(node.func, "id", getattr(node.func, "attr", "")).endswith("Error"):
            for argument in (*node.args, *(keyword.value for keyword in node.keywords)):
                if isinstance(argument, ast.Constant) and isinstance(argument.value, str):
                    yield argument.value
                elif isinstance(argument, ast.JoinedStr):
                    yield "".join(
                        str(part.value) if isinstance(part, ast.Constant) else "value" for part in argument.values
                    )


def test_a_sentence_has_forty_words_at_most_and_twenty_on_average() -> None:
    words = {(page, each): count_words(each) for page in PAGES for each in sentences(page.read_text(encoding="utf-8"))}
    assert [place for place, count in words.items() if count > LONGEST] == []
    # Of two words and less are names and captions, no sentences.
    counts = [count for count in words.values() if count > 2]
    assert len(counts) > 1000
    assert mean(counts) <= AVERAGE


def test_a_sentence_of_the_page_of_a_check_has_twenty_words_on_average() -> None:
    means = {page.stem: mean(map(count_words, sentences(page.read_text(encoding="utf-8")))) for page in CHECKS}
    assert {check: words for check, words in means.items() if words > AVERAGE} == {}


def test_no_message_of_an_error_has_a_sentence_longer_than_forty_words() -> None:
    texts = [text for path in SOURCES for text in messages(path.read_text(encoding="utf-8"))]
    assert len(texts) > 500
    assert [text for text in texts if any(count_words(sentence) > LONGEST for sentence in END.split(text))] == []


def test_what_a_sentence_is() -> None:
    """Lists, tables and code do not run together with the text before them; code is a word."""
    page = "# Title of it\n\nOne two `a b c`. Three\nfour:\n- five six\n- seven\n\n| a | b |\n\n```sh\ncode here\n```\n"
    assert list(sentences(page)) == ["One two `code`.", "Three four:", "- five six", "- seven", ""]
    assert [count_words(each) for each in sentences(page)] == [3, 2, 2, 1, 0]


def test_what_a_message_is() -> None:
    source = "raise InputError(f'no {what} here', why='it is gone', todo=f'{x}')\nother('not this')"
    assert list(messages(source)) == ["no value here", "it is gone", "value"]
