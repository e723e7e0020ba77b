"""Judge engines as renderers and write what comes out to docs/engines.md: `make engines`.

Suites that are named are judged instead of all: `make engines SUITES="solids seams"`. Every number on the page,
and which suites it covers, is read from the results; `CAUSES` adds a sentence to what fails.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path

import hapticeval
from hapticeval.examples.engines.causes import CAUSES
from hapticeval.runner.results import VerdictEntry

SUITES = ("field", "seams", "solids", "unilateral-surfaces", "hard-cases")
PAGE = Path("docs/engines.md")
COLUMNS = {
    "mujoco-query": "hapticeval.examples.engines.mujoco_tools:Query",
    "mujoco-coupled": "hapticeval.examples.engines.mujoco_tools:Coupled",
    "mujoco-stiff": "hapticeval.examples.engines.mujoco_tools:Stiff",
    "fcl-triangles": "hapticeval.examples.engines.fcl_tools:Triangles",
    "fcl-convex": "hapticeval.examples.engines.fcl_tools:Convex",
    "fcl-coupled": "hapticeval.examples.engines.fcl_tools:Coupled",
}

REMEDIES = {
    "mujoco-query": "mujoco-stiff",
    "mujoco-coupled": "mujoco-stiff",
    "fcl-triangles": "fcl-convex",
    "fcl-convex": "fcl-coupled",
}
"""The column of the setting, or of the other use, that was tried against what fails in a column."""

INTRODUCTION = """\
# Physics engines as renderers

MuJoCo {mujoco} and python-fcl {fcl}, judged as renderers in two uses. A query asks for the depth at the hand and puts a
spring on it. A coupled tool is a ball that the hand holds by a spring and that contacts push. The adapters stand in
`examples/engines`, some 40 lines a class, for you to change. The extra `engines` of the package has the wheels, and
`make engines` writes this page.

| column | use | setting |
| --- | --- | --- |
| `mujoco-query` | query | defaults |
| `mujoco-coupled` | coupled tool | defaults: `solref 0.02 1` |
| `mujoco-stiff` | coupled tool | `solref 0.002 1`: a time constant of two ticks, the least that MuJoCo advises |
| `fcl-triangles` | query | the mesh as triangles |
| `fcl-convex` | query | the mesh as a convex body |
| `fcl-coupled` | coupled tool | a convex body, and a contact spring ten times as stiff as the coupling |

None of them claims to be a haptic renderer. MuJoCo documents that a mesh collides as its convex hull: models that are
not convex are outside of its scope unless they are cut into convex parts, which was not tried. It documents too that
its contacts are soft. Triangles of FCL are a surface without an inside. Its convex body takes convex models only, and
the adapter refuses the others.

Judged are {cases} cases of the suites {suites}: {decided} verdicts that decide, of level must or should.
The table has how many pass, of how many; a dash where none decides."""


def title_of(entry: VerdictEntry) -> str:
    """Return the column of a verdict."""
    return next(title for title, name in COLUMNS.items() if name == entry.renderer)


def count_words(entries: Sequence[VerdictEntry]) -> str:
    """Return how many verdicts pass, of how many that decide."""
    outcomes = Counter(entry.outcome for entry in entries)
    decided = outcomes["pass"] + outcomes["fail"]
    stopped = f", {outcomes['error']} in error" if outcomes["error"] else ""
    return (f"{outcomes['pass']}/{decided}" if decided else "-") + stopped


def failure_line(column: str, check: str, entries: Sequence[VerdictEntry]) -> str:
    """Return the row of a check that fails in a column: how often, the worst case, its cause, and what the remedy does.

    `entries` are the check's verdicts in all columns.
    """
    failed = [entry for entry in entries if title_of(entry) == column and entry.outcome == "fail"]
    # A metric without a finite margin is the worst there is.
    worst = min(failed, key=lambda entry: -float("inf") if entry.margin is None else entry.margin)
    message = f"{worst.suite}/{worst.case}: {worst.message}".replace("|", "\\|")
    cause = CAUSES.get((column, check), "cause not looked into")
    cells = [f"[{check}](checks/{check}.md)", str(len(failed)), message, cause]
    if column in REMEDIES:
        places = {(entry.suite, entry.case) for entry in failed}
        remedied = [
            entry for entry in entries if title_of(entry) == REMEDIES[column] and (entry.suite, entry.case) in places
        ]
        cells.append(count_words(remedied))
    return f"| {' | '.join(cells)} |"


def page(entries: Sequence[VerdictEntry]) -> str:
    """Return the page of the verdicts of a run."""
    asked = [entry for entry in entries if entry.level in ("must", "should")]
    by_check: dict[str, list[VerdictEntry]] = {}
    for entry in asked:
        by_check.setdefault(entry.check, []).append(entry)
    lines = [
        INTRODUCTION.format(
            mujoco=version("mujoco"),
            fcl=version("python-fcl"),
            cases=len({(entry.suite, entry.case) for entry in asked if entry.outcome in ("pass", "fail")}),
            suites=", ".join(f"`{suite}`" for suite in dict.fromkeys(entry.suite for entry in asked)),
            decided=sum(entry.outcome in ("pass", "fail") for entry in asked),
        ),
        "",
        "| | " + " | ".join(f"`{column}`" for column in COLUMNS) + " |",
        "| --- " * (len(COLUMNS) + 1) + "|",
    ]
    for check, of_check in by_check.items():
        cells = [count_words([entry for entry in of_check if title_of(entry) == column]) for column in COLUMNS]
        if set(cells) != {"-"}:
            lines.append(f"| [{check}](checks/{check}.md) | " + " | ".join(cells) + " |")
    lines += ["", "## What fails, and why", "", "Of a check's failures the worst is shown, with its cause."]
    for column in COLUMNS:
        failing = dict.fromkeys(entry.check for entry in asked if title_of(entry) == column and entry.outcome == "fail")
        heads = ["check", "fails", "the worst", "its cause"]
        if column in REMEDIES:
            heads.append(f"of these pass as `{REMEDIES[column]}`")
        lines += ["", f"### {column}", "", f"| {' | '.join(heads)} |", "| --- " * len(heads) + "|"]
        lines += [failure_line(column, check, by_check[check]) for check in failing]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    suites = tuple(sys.argv[1:]) or SUITES
    # One process: a world of a fine mesh takes gigabytes.
    results = hapticeval.run(list(COLUMNS.values()), suites=suites, workers=1)
    PAGE.write_text(page(results.verdicts), encoding="utf-8")
