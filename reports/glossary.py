"""The words of the pages that a newcomer cannot know: told where each first stands on a page, and all on one page."""

from __future__ import annotations

import re
from collections.abc import Mapping
from html import escape
from types import MappingProxyType

GLOSSARY: Mapping[str, str] = MappingProxyType(
    {
        "HIP": "haptic interface point: where the hand is, which may be inside the model",
        "IHIP": "ideal haptic interface point: where the renderer puts the tool, on the surface; others call it proxy "
        "or god-object",
        "unexpected": "not as expected: a check that must pass fails or cannot decide, the renderer breaks, or the "
        "outcome is not the published one; a known or an inherent failure is expected",
        "as expected": "the published outcome; where none is published, whatever stops no gate: a pass, a failure that "
        "is known or inherent, a warning",
        "inherent": "a failure that follows by a theorem from what the renderer declares to be, such as a spring or "
        "free of memory",
        "known": "a failure that a list of known failures has, with the reason",
        "pop-through": "the tool jumps to a distant part of the surface while the hand hardly moves",
        "n_pre": "the outward normal of the face that was touched before the corner",
        "depths": "penetration depths: of a length, how many times the distance from HIP to IHIP it is",
        "medial axis": "the points inside a model with more than one nearest point on its surface",
        "margin": "what is left of a bound: the bound less what was measured",
        "standoff": "how far from the surface a renderer declares to keep its tool",
    }
)
"""What a word means, in one line."""

WHOLE = re.compile(
    r"(<(?P<element>script|style|svg|title|select|button|abbr|dfn|code)\b.*?</(?P=element)>|<[^>]*>)", re.DOTALL
)
"""What is no running text in a page: tags, and elements in which no word is explained."""

WORD = re.compile(rf"(?<![\w-])({'|'.join(map(re.escape, GLOSSARY))})(?![\w-])")


def explain_terms(page: str) -> str:
    """Return a page of HTML in which each word of `GLOSSARY` is an `<abbr>` with its meaning where it first stands."""
    explained: set[str] = set()

    def explanation(match: re.Match[str]) -> str:
        word = match[0]
        if word in explained:
            return word
        explained.add(word)
        return f'<abbr title="{escape(GLOSSARY[word], quote=True)}">{word}</abbr>'

    parts: list[str] = []
    end = 0
    for markup in WHOLE.finditer(page):
        parts += [WORD.sub(explanation, page[end : markup.start()]), markup[0]]
        end = markup.end()
    return "".join([*parts, WORD.sub(explanation, page[end:])])
