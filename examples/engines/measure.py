"""Judge engines as renderers and write what comes out to docs/engines.md: `make engines`.

Suites that are named are judged instead of all: `make engines SUITES="solids seams"`. Every number on the page,
and which suites it covers, is read from the results; `CAUSES` adds a sentence to what fails.
"""

from __future__ import annotations

import csv
import sys
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from typing import NamedTuple

import hapticeval
from hapticeval.discovery import resolve
from hapticeval.examples.engines.causes import CAUSES
from hapticeval.examples.studies.field_tables import count_lines
from hapticeval.examples.studies.plates import holds, narrow_border
from hapticeval.phenomena.verdict import Level, Outcome
from hapticeval.renderer import AtRest, RendererFactory
from hapticeval.runner.judging import judge
from hapticeval.runner.results import VerdictEntry
from hapticeval.scene import Scene
from hapticeval.suite.reading import load_suite

HARD_CASES = "hard-cases"
"""The group of suites in which a setting is tried where a column fails, and nowhere else: their models are large."""
SUITES = ("field", "seams", "solids", "unilateral-surfaces", HARD_CASES)

PAGE, RESULTS = Path("docs/engines.md"), Path("results/engines")
SMALLEST = Path(__file__).with_name("smallest.csv")
"""The smallest paths, which `make engines-smallest` writes."""

COLUMNS = {
    "mujoco-query": "hapticeval.examples.engines.mujoco_tools:Query",
    "mujoco-coupled": "hapticeval.examples.engines.mujoco_tools:Coupled",
    "mujoco-stiff": "hapticeval.examples.engines.mujoco_tools:Stiff",
    "fcl-triangles": "hapticeval.examples.engines.fcl_tools:Triangles",
    "fcl-convex": "hapticeval.examples.engines.fcl_tools:Convex",
    "fcl-coupled": "hapticeval.examples.engines.fcl_tools:Coupled",
    "bullet-query": "hapticeval.examples.engines.bullet_tools:Query",
    "bullet-coupled": "hapticeval.examples.engines.bullet_tools:Coupled",
}

SETTINGS = {
    "exact": "hapticeval.examples.engines.mujoco_tools:Exact",
    "parts": "hapticeval.examples.engines.mujoco_tools:Parts",
    "fine": "hapticeval.examples.engines.mujoco_tools:Fine",
    "shown": "hapticeval.examples.engines.mujoco_tools:Shown",
    "other-solver": "hapticeval.examples.engines.fcl_tools:OtherSolver",
    "fcl-shown": "hapticeval.examples.engines.fcl_tools:Shown",
    "bullet-exact": "hapticeval.examples.engines.bullet_tools:Exact",
    "bullet-fine": "hapticeval.examples.engines.bullet_tools:Fine",
    "bullet-shown": "hapticeval.examples.engines.bullet_tools:Shown",
    "bullet-swept": "hapticeval.examples.engines.bullet_tools:Swept",
}
"""Settings that are tried against what fails, each a class of its own."""

PLATES, SPEEDS = (5e-4, 2e-3, 5e-3), (0.02, 0.2, 1.0, 2.0)
"""Thicknesses of plates, m, and speeds of the hand, m/s, of the table of pushes."""

LEAST_PUSH, LARGEST_PUSH = 0.2, 40.0
"""Pushes between which the largest that is held is looked for, N."""

TRIED = {
    "mujoco-query": ("exact", "parts", "fine", "shown"),
    "mujoco-coupled": ("mujoco-stiff", "fine", "shown"),
    "mujoco-stiff": ("fine", "shown"),
    "fcl-triangles": ("fcl-convex",),
    "fcl-convex": ("other-solver", "fcl-coupled"),
    "fcl-coupled": ("fcl-shown",),
    "bullet-query": ("bullet-exact", "bullet-coupled"),
    "bullet-coupled": ("bullet-fine", "bullet-shown", "bullet-swept"),
}
"""What was tried against what fails in a column: settings, or another column."""

INTRODUCTION = """\
# Physics engines as renderers

MuJoCo {mujoco}, python-fcl {fcl} and Bullet, as pybullet {bullet}, judged as renderers in two uses. A query asks for
the depth at the hand and puts a spring on it. A coupled tool is a ball that the hand holds by a spring and that
contacts push. The adapters stand in `examples/engines`, some 40 lines a class, for you to change. The extra `engines`
of the package has the wheels; pybullet has them for Python 3.11 on Linux alone. `make engines` writes this page.

| column | use | setting |
| --- | --- | --- |
| `mujoco-query` | query | defaults |
| `mujoco-coupled` | coupled tool | defaults: `solref 0.02 1` |
| `mujoco-stiff` | coupled tool | `solref 0.002 1`: a time constant of two ticks, the least that MuJoCo advises |
| `fcl-triangles` | query | the mesh as triangles |
| `fcl-convex` | query | the mesh as a convex body |
| `fcl-coupled` | coupled tool | a convex body, and a contact spring ten times as stiff as the coupling |
| `bullet-query` | query | the mesh as a convex hull, whose margin of 1 mm is declared as standoff |
| `bullet-coupled` | coupled tool | the same hull; the mesh as triangles where it is not convex |

Against what fails these were tried, on the same cases, and of the hard ones on those that fail:

| setting | what it is |
| --- | --- |
| `exact` | the query with `ccd_tolerance` 1e-12, where the default is 1e-6 |
| `parts` | the query with a model that is not convex cut into two convex parts by the plane of a face |
| `fine` | the coupled tool in ten time steps a tick, and `solref 0.0002 1`: again two steps |
| `shown` | the same, and the hand is shown the contact alone: the spring without damper, and nothing of a free tool |
| `other-solver` | the convex body with `GST_INDEP` for libccd: deep in the ellipsoid 0.6 to 14 per cent of the depth |
| `fcl-shown` | the coupled tool of FCL, and the hand is shown the contact alone |
| `bullet-exact` | the query of a hull without a margin |
| `bullet-fine` | the coupled tool of Bullet in ten time steps a tick |
| `bullet-shown` | the same, and the hand is shown the contact alone |
| `bullet-swept` | the coupled tool on triangles, swept from step to step (`ccdSweptSphereRadius`) |

None of them claims to be a haptic renderer. MuJoCo documents that a mesh collides as its convex hull: models that are
not convex are outside of its scope unless they are cut into convex parts. It documents too that its contacts are soft.
Triangles of FCL are a surface without an inside. Its convex body takes convex models only, and the adapter refuses the
others; so does that of Bullet's query.

Judged are {cases} cases of the suites {suites}: {decided} verdicts that decide, of level must or should.
The table has how many pass, of how many; a dash where none decides."""

SETTINGS_WORDS = """\
The same of what was tried, without the hard cases: a setting that mends one check may cost another."""

CHANGES = """\
## What to change

- **Hold a tool, and do not ask for a depth.** A query forgets where the hand came from: it tunnels, and changes sides
  under edges. A tool that is held stays in front of a plate that the hand presses. At 2 m/s that takes short steps
  (`fine`) or a hull's margin. Where the hand is shown the contact alone it passes 6 of 8 edges (`shown`), or all of
  them (`bullet-shown`).
- **Make contact and time step short together.** A contact's time constant times the hand's speed is how far a tool
  gets: 2 ms at 2 m/s is 4 mm. `fine` holds 0.5 mm at any speed and push of the table.
- **Show the hand the contact, not the tool.** A free tool's inertia and the coupling's damper are in most of what fails
  in a coupled column. `shown`, `fcl-shown` and `bullet-shown` mend every `force-magnitude` and `never-pulls`. They cost
  `contact-kept`: the damper pulls the tool off the surface some 5 to 25 ticks before a hand that leaves is out.
- **Cut models that are not convex.** Two boxes for an L mend `field/in-a-notch`; what is left in
  `solids/l-block-notch` is the query's change of sides.
- **Of FCL take convex bodies with few facets.** On plane faces depth and normal are right to 0.01 degrees; of 5,120
  facets they are not."""


PLATES_WORDS = """\
## Which plates hold

The largest push, N, at which a tool stays in front of a plate, along the path of `examples/studies/plates.py`: the hand
comes at a speed and stops where a spring of 1000 N/m pushes as much. Looked for between 0.2 and 40 N, to 2 per cent."""

FACTS = """\
What is known of MuJoCo as a renderer, and where it shows here:

- **Under the medial plane of a box the force flips by 90 degrees**: `mujoco-query` fails `continuous-contact` and
  `broken-contact` at edges, since the nearest face is another one there.
- **A mesh is its convex hull**: in a notch, which is free space, the hand is pushed, in `seams/corner-of-three` by
  48 N and more. All three columns fail `contact-kept` there, and in `field/in-a-notch`, which passes where the model is
  cut into two parts (`parts`).
- **With the default `solref 0.02` a tool falls through plates under a slow push**: the first three lines of the table.
- **With `solref 0.002` it holds a plate of 0.5 mm**, at any push tried, as long as the hand is slow: up to 0.42 m/s. At
  20 N it sinks in by 0.09 mm. At 1 and 2 m/s it does not, which is why `mujoco-stiff` fails `contact-kept` there. The
  tool goes on for the contact's time constant, 2 ms, and is behind the plate by then. What helps is a shorter one, for
  which the time step has to be shorter too (`fine`). Ten steps with `solref 0.002` hold up to 0.43 m/s, `impratio` 100
  and the integrator `implicitfast` 0.42 m/s, as before; a contact spring of 1e5 N/m (`solref -1e5 -200`) 0.16 m/s.
- **A query tunnels where a tick leaps the plate**: `mujoco-query` fails `contact-kept` in `solids/plate`.

And of Bullet:

- **A hull stands off by its margin**, 1 mm unless it is told otherwise: no path of the table goes through a plate with
  it at 1 m/s. Without the margin (`bullet-exact`) the query tunnels in `solids/plate`.
- **A small ball passes triangles in a tick**: one of 0.1 mm goes through every plate of triangles from 0.2 m/s on.
  Swept from step to step (`bullet-swept`) it goes through none."""

FAILURES_WORDS = """\
## What fails, and why

The table shows the worst of a check's failures, with its cause. The smallest path is the first case of few points and
triangles that fails, shrunk as `hapticeval search` does; `make engines-smallest` writes it. What was tried names how
many of the failing verdicts pass by it."""


class Smallest(NamedTuple):
    """The smallest path on which a column fails a check: from which `case`, the `path` in words, and what is said."""

    column: str
    check: str
    case: str
    path: str
    message: str


def read_smallest() -> dict[tuple[str, str], Smallest]:
    """Return what `make engines-smallest` has written, by column and check."""
    with SMALLEST.open(encoding="utf-8", newline="") as file:
        rows = [Smallest(**row) for row in csv.DictReader(file)]
    return {(row.column, row.check): row for row in rows}


def largest_push(factory: RendererFactory, thickness: float, speed: float) -> str:
    """Return in words the largest push (N) that a plate of `thickness` (m) holds at a `speed` (m/s), by bisection."""
    low, high = LEAST_PUSH, LARGEST_PUSH
    if not holds(factory, thickness, speed, low):
        return "none"
    if holds(factory, thickness, speed, high):
        return f"{high:g} and more"
    return f"{narrow_border(lambda push: holds(factory, thickness, speed, push), low, high):.2g}"


def plate_lines() -> list[str]:
    """Return the table of pushes that plates hold: a line for a tool and a thickness, a column for a speed."""
    heads = ["tool", "plate", *(f"{speed:g} m/s" for speed in SPEEDS)]
    lines = [f"| {' | '.join(heads)} |", "| --- " * len(heads) + "|"]
    for title in ("mujoco-coupled", "mujoco-stiff", "fine", "fcl-coupled", "bullet-coupled", "bullet-swept"):
        factory = resolve((COLUMNS | SETTINGS)[title])
        for thickness in PLATES:
            pushes = [largest_push(factory, thickness, speed) for speed in SPEEDS]
            lines.append(f"| `{title}` | {1e3 * thickness:g} mm | {' | '.join(pushes)} |")
    return lines


MOVING_WORDS = """\
## Bodies that move

The cases in space of the suite `moving`: how many verdicts of level must pass, of how many, where the engine itself
moves the model: MuJoCo a mocap body, FCL a transform, Bullet a body without mass. Beside it the same with the model at
rest in the engine and the hand taken into its frame (`hapticeval.AtRest`). What passes at rest alone is lost by the
motion."""


def at_rest_in(factory: RendererFactory) -> RendererFactory:
    """Return the factory of an engine that never moves the model: the hand is taken into the frame of the body."""

    def make(scene: Scene) -> AtRest:
        return AtRest(factory(replace(scene, motion=None)))

    return make


def moving_lines() -> list[str]:
    """Return the table of bodies that move: a line for each column of the page, a cell for each case in space."""
    cases = [case for case in load_suite("moving").cases if case.build_scene().model.dimension == 3]
    heads = ["", *(case.name for case in cases), "lost by the motion"]
    lines = [f"| {' | '.join(heads)} |", "| --- " * len(heads) + "|"]
    for title, name in COLUMNS.items():
        cells, lost = [], []
        for case in cases:
            factory = resolve(name)
            passed = [
                {
                    verdict.check: verdict.outcome is Outcome.PASS
                    for verdict in judge(made, title, "moving", case).verdicts
                    if verdict.level is Level.MUST and verdict.outcome in (Outcome.PASS, Outcome.FAIL)
                }
                for made in (factory, at_rest_in(factory))
            ]
            counts = [f"{sum(checks.values())}/{len(checks)}" if checks else "-" for checks in passed]
            cells.append(counts[0] if not passed[0] else f"{counts[0]}, at rest {counts[1]}")
            moves, rests = passed
            lost += [f"`{check}` in {case.name}" for check, passes in rests.items() if passes and not moves.get(check)]
        lines.append(f"| `{title}` | {' | '.join(cells)} | {'; '.join(lost) or 'nothing'} |")
    return lines


def title_of(entry: VerdictEntry) -> str:
    """Return the column of a verdict."""
    return next(title for title, name in (COLUMNS | SETTINGS).items() if name == entry.renderer)


def is_hard(entry: VerdictEntry) -> bool:
    """Return whether a verdict is of a hard case."""
    return entry.suite.startswith(HARD_CASES)


def failing_places(entries: Sequence[VerdictEntry], setting: str) -> list[str]:
    """Return the CASE/CHECK of hard cases that fail in a column against which a setting is tried, each once."""
    columns = [column for column, tried in TRIED.items() if setting in tried]
    failing = [entry for entry in entries if is_hard(entry) and entry.outcome == "fail" and entry.level != "info"]
    return list(dict.fromkeys(f"{entry.case}/{entry.check}" for entry in failing if title_of(entry) in columns))


def tried_words(column: str, failing: int, entries: Sequence[VerdictEntry]) -> str:
    """Return how many of the `failing` verdicts of a check pass by each setting tried, of how many that it decides.

    `entries` are the check's verdicts in all columns and settings, at the places where this column fails.
    """
    counts = {
        setting: Counter(entry.outcome for entry in entries if title_of(entry) == setting) for setting in TRIED[column]
    }
    decided = {
        setting: f"`{setting}` {count['pass']}/{count['pass'] + count['fail']}"
        for setting, count in counts.items()
        if count["pass"] + count["fail"]
    }
    if not decided:  # refused, as a model that is not convex
        undecided = ", ".join(f"`{setting}`" for setting, count in counts.items() if count)
        return f"not decided with {undecided}" if undecided else "not tried"
    passes = [counts[setting]["pass"] for setting in decided]
    outcome = "mended" if max(passes) == failing else "in part" if any(passes) else "no setting of it mends this"
    return f"{outcome}: {', '.join(decided.values())}"


def failure_line(
    column: str, check: str, entries: Sequence[VerdictEntry], smallest: Mapping[tuple[str, str], Smallest]
) -> str:
    """Return the row of a check that fails in a column: how often, the worst case, its cause, and what was tried.

    `entries` are the check's verdicts in all columns.
    """
    failed = [entry for entry in entries if title_of(entry) == column and entry.outcome == "fail"]
    # A metric without a finite margin is the worst there is.
    worst = min(failed, key=lambda entry: -float("inf") if entry.margin is None else entry.margin)
    message = f"{worst.suite}/{worst.case}: {worst.message}".replace("|", "\\|")
    cause = CAUSES.get((column, check), "cause not looked into")
    path = smallest.get((column, check))
    path_words = "as it is: not shrunk" if path is None else f"{path.case}: {path.path}"
    cells = [f"[{check}](checks/{check}.md)", str(len(failed)), message, path_words, cause]
    places = {(entry.suite, entry.case) for entry in failed}
    at_places = [entry for entry in entries if (entry.suite, entry.case) in places]
    cells.append(tried_words(column, len(failed), at_places))
    return f"| {' | '.join(cells)} |"


def page(
    entries: Sequence[VerdictEntry],
    plates: Sequence[str],
    moving: Sequence[str],
    smallest: Mapping[tuple[str, str], Smallest],
) -> str:
    """Return the page of the verdicts of a run, with plates, bodies that move, and smallest paths."""
    asked = [entry for entry in entries if entry.level in ("must", "should")]
    of_columns = [entry for entry in asked if title_of(entry) in COLUMNS]
    by_check: dict[str, list[VerdictEntry]] = {}
    for entry in asked:
        by_check.setdefault(entry.check, []).append(entry)
    lines = [
        INTRODUCTION.format(
            mujoco=version("mujoco"),
            fcl=version("python-fcl"),
            bullet=version("pybullet"),
            cases=len({(entry.suite, entry.case) for entry in of_columns if entry.outcome in ("pass", "fail")}),
            suites=", ".join(f"`{suite}`" for suite in dict.fromkeys(entry.suite for entry in asked)),
            decided=sum(entry.outcome in ("pass", "fail") for entry in of_columns),
        ),
        "",
        *count_lines(entries, COLUMNS),
    ]
    of_settings = [entry for entry in asked if title_of(entry) in SETTINGS and not is_hard(entry)]
    if of_settings:
        lines += ["", SETTINGS_WORDS, "", *count_lines(of_settings, SETTINGS)]
    lines += ["", CHANGES, "", PLATES_WORDS, "", *plates, "", FACTS, "", MOVING_WORDS, "", *moving, "", FAILURES_WORDS]
    for column in COLUMNS:
        failing = dict.fromkeys(entry.check for entry in asked if title_of(entry) == column and entry.outcome == "fail")
        heads = ["check", "fails", "the worst", "the smallest path", "its cause", "tried, and how many of these pass"]
        lines += ["", f"### {column}", "", f"| {' | '.join(heads)} |", "| --- " * len(heads) + "|"]
        lines += [failure_line(column, check, by_check[check], smallest) for check in failing]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    suites = tuple(sys.argv[1:]) or SUITES
    # One process: a world of a fine mesh takes gigabytes.
    verdicts = list(hapticeval.run(list(COLUMNS.values()), suites=suites, workers=1, output=RESULTS).verdicts)
    tried_in = [suite for suite in suites if suite != HARD_CASES]
    if tried_in:
        verdicts += hapticeval.run(list(SETTINGS.values()), suites=tried_in, workers=1).verdicts
    for setting, name in SETTINGS.items():
        if places := failing_places(verdicts, setting):
            verdicts += hapticeval.run(name, suites=HARD_CASES, select=places, workers=1).verdicts
    PAGE.write_text(page(verdicts, plate_lines(), moving_lines(), read_smallest()), encoding="utf-8")
