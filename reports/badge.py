"""A badge of a run: how many of the judged verdicts pass, as SVG and as the JSON of an endpoint of shields.io."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path
from xml.sax.saxutils import escape

from hapticeval.files import write_text
from hapticeval.runner.results import ResultsDocument
from hapticeval.runner.standing import Standing

BADGE_COLOURS = {"brightgreen": "#1a7f37", "yellow": "#9a6700", "red": "#cf222e", "lightgrey": "#57606a"}
"""Names of shields.io, and what the SVG has for them: white text on each has a contrast of at least 4.5 to 1."""


def badge_label(results: ResultsDocument) -> str:
    """Return the badge's left field: the suite with its version where there is one alone."""
    labels = [suite.label for suite in results.suites]
    return f"hapticeval {labels[0]}" if len(labels) == 1 else "hapticeval"


def badge_words(results: ResultsDocument) -> tuple[str, str]:
    """Return the badge's text and colour: red where the gate stops, yellow where known failures do not stop it."""
    # Information and checks that do not apply are not a part of the share.
    standings = Counter(verdict.standing for verdict in results.verdicts if verdict.standing.judged)
    judged, passed = standings.total(), standings[Standing.PASS]
    excused = [standing for standing in Standing if standing.excused and standings[standing]]
    noted = [f"{standings[standing]} {standing.words}" for standing in excused]
    text = ", ".join([f"{passed}/{judged} pass", *noted])
    if not results.complete:
        return f"incomplete: {text}", "lightgrey"
    if not judged:
        return "nothing judged", "lightgrey"
    # Red is what fails a gate, whatever the share that passes.
    if results.stopping:
        return text, "red"
    return text, "brightgreen" if passed == judged else "yellow"


def badge_svg(results: ResultsDocument) -> str:
    """Return the badge as SVG. Text is fitted to widths reckoned at 6.6 px a character, whatever font there is."""
    label = badge_label(results)
    text, colour = badge_words(results)
    # Widths in px of the two fields, each with 6 px on either side of its text.
    left, right = (round(6.6 * len(part)) + 12 for part in (label, text))
    title = escape(f"{label}: {text}")
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{left + right}" height="20" role="img" aria-label="{title}">',
        f"<title>{title}</title>",
        f'<clipPath id="r"><rect width="{left + right}" height="20" rx="3"/></clipPath>',
        f'<g clip-path="url(#r)"><rect width="{left}" height="20" fill="#24292f"/>',
        f'<rect x="{left}" width="{right}" height="20" fill="{BADGE_COLOURS[colour]}"/></g>',
        '<g fill="#fff" font-family="Verdana,DejaVu Sans,sans-serif" font-size="11" text-anchor="middle">',
        *(
            f'<text x="{place}" y="14" textLength="{width - 12}" lengthAdjust="spacingAndGlyphs">{escape(part)}</text>'
            for place, width, part in ((left / 2, left, escape(label)), (left + right / 2, right, text))
        ),
        "</g></svg>",
    ]
    return "\n".join(parts) + "\n"


def write_badge(directory: Path, results: ResultsDocument) -> list[Path]:
    """Write badge.svg and badge.json and return their paths. Raises `HapticevalError` where that cannot be done."""
    words, colour = badge_words(results)
    # What shields.io/endpoint reads.
    document = {"schemaVersion": 1, "label": badge_label(results), "message": words, "color": colour}
    texts = {"badge.svg": badge_svg(results), "badge.json": json.dumps(document, indent=1) + "\n"}
    for name, text in texts.items():
        write_text(directory / name, text)
    return [directory / name for name in texts]
