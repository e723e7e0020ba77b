"""The results document: what ran, what was found, and whether that is all of it; the one input of every report.

The types below are its only definition: `results_schema` is made from them, reading checks a file against them, and
writing gives what reading takes.
"""

from __future__ import annotations

import math
import os
import platform
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import asdict
from functools import cache, cached_property
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal, NamedTuple, Self

import msgspec
from msgspec import Meta

from hapticeval.devices.inner_loop import InnerLoop
from hapticeval.devices.point_mass import PointMass
from hapticeval.errors import HapticevalError, InputError, RefusalError, RendererError, UnknownNameError, kind_of
from hapticeval.files import digest_of, plain, read_json, without_non_finite, write_json
from hapticeval.phenomena.verdict import Level, Outcome, Verdict
from hapticeval.quantity import format_quantity, plural
from hapticeval.recordings.difference import Difference
from hapticeval.runner.standing import Standing, counts_in_words, standing_of

if TYPE_CHECKING:
    from hapticeval.geometry.model import Model
    from hapticeval.recordings.recording import Recording

RESULTS_FILE = "results.json"
FORMAT_VERSION: Final = 1

RunKey = tuple[str, str, str]
"""Suite, case, renderer."""

Count = Annotated[int, Meta(ge=0)]
Table = dict[str, dict[str, Literal["Yes", "No"]]]
"""Title of a row, then renderer, then Yes or No."""


class Entry(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True, kw_only=True):
    """Base of the document's objects: a field that has its default is left out of the file."""


FELT_STIFFNESS = 1000.0
"""N/m by which a length is compared with a force, that of the suites. *Chosen*: a millimetre for a newton."""


class SuiteEntry(Entry, frozen=True, kw_only=True):
    """A suite that ran, and the titles of the rows of the table that its cases fill.

    `cases` and `renderers` are what was planned of it, in that order; `cells` holds for each row the `case/check` that
    decide it. Suites of one `digest` say the same, word by word; cases of one digest in `case_digests` ask the same.
    Within one `version` a renderer that stays the same keeps its verdicts; "" for a suite without one.
    """

    name: str
    title: str
    citation: str
    rows: list[str]
    cases: list[str] = []
    renderers: list[str] = []
    cells: dict[str, list[str]] = {}
    version: str = ""
    digest: str = ""
    case_digests: dict[str, str] = {}

    @property
    def label(self) -> str:
        """The suite's name with its version, as it is cited: thesis 1.0."""
        return f"{self.name} {self.version}".rstrip()


class Command(Entry, frozen=True, kw_only=True):
    """What the user asked for: in a strict run a warning stops a gate; `shard` is a part of the plan, as 3/16."""

    suites: list[str]
    renderers: list[str]
    select: list[str]
    strict: bool
    shard: Annotated[str, Meta(pattern=r"^[1-9][0-9]*/[1-9][0-9]*$")] | None = None


class Timing(Entry, frozen=True, kw_only=True):
    """Seconds simulated, seconds taken, and their ratio."""

    simulated_seconds: float
    wall_seconds: float
    times_real_time: float


class Environment(Entry, frozen=True, kw_only=True):
    """What the numbers may depend on; `versions` maps distributions to theirs, None for one that is not installed."""

    python: str
    platform: str
    cpu_count: int | None
    versions: dict[str, str | None]


class Problem(Entry, frozen=True, kw_only=True):
    """An error that stopped a run, with the exit code that it calls for: 3 where the renderer broke."""

    what: str
    why: str
    todo: str
    exit_code: int = RendererError.exit_code

    @property
    def kind(self) -> tuple[str, str]:
        """What errors of one cause have in common: their message without numbers and places, and its reason."""
        return kind_of(self.what), self.why

    @classmethod
    def of(cls, error: HapticevalError, **more: Any) -> Self:
        """Return the entry of an error, with `more` fields of a subclass."""
        return cls(what=error.what, why=error.why, todo=error.todo, exit_code=error.exit_code, **more)


class Refusal(Problem, frozen=True, kw_only=True):
    """Why the renderer refused the scene, and at which `position` (m) of the model, if it says so."""

    exit_code: int = RefusalError.exit_code
    position: list[float] | None


class Ended(Entry, frozen=True, kw_only=True):
    """When (s) and why a run ended before its time: device or law left its domain, or the loop `ran_away`."""

    tick: Count
    time: float
    what: str
    why: str
    ran_away: bool = False


class Robot(Entry, frozen=True, kw_only=True):
    """The device of an experiment; the choices of dynamics and base inertia where it offers them.

    `constants` are those of a parallelogram robot that are not in Table A.1, by name, in their SI units.
    """

    kind: str
    dynamics: str | None = None
    base_inertia: str | None = None
    constants: dict[str, float] = {}

    @property
    def turning(self) -> bool:
        """Whether its joints turn: see `devices.device.Device.turning`."""
        return self.kind != PointMass.name


class SceneEntry(Entry, frozen=True, kw_only=True):
    """A scene's numbers in SI units and its effects; device and inner loop only of an experiment.

    `believed` is what the inner loop takes the device for, where that is another one.
    """

    stiffness: float
    damping: float
    mass: float
    bilateral: bool
    restitution: float
    sampling_time: float
    device: Robot | None = None
    inner_loop: InnerLoop | None = None
    believed: Robot | None = None
    effects: list[dict[str, Any]] = []


class Replay(Entry, frozen=True, kw_only=True):
    """What a replay adds to a run: the recording's file, what of it was used, and how far this renderer is from it.

    `clock` says how its times were taken, `rows_left_out` and `left_out` what could not be used and why. `difference`
    (m, N, s) is None for the recorded run itself.
    """

    file: str
    note: str
    clock: str
    stretches: int
    rows: int
    rows_left_out: int
    left_out: list[str]
    suspicious: list[str]
    seconds: float
    difference: Difference | None


class RunEntry(Entry, frozen=True, kw_only=True):
    """One renderer in one case. `closed_form` names the formula that its law follows there, if it has one.

    `step_seconds` is the median time of a step, where steps were asked for one by one.
    """

    suite: str
    case: str
    renderer: str
    recording: (
        Annotated[
            str,
            Meta(
                # below the result folder: no `..`, no backslash, no absolute path
                pattern=r"^recordings/(?!(.*/)?\.\.(/|$))[^\\]+$",
                description="path of the recording below the result folder",
            ),
        ]
        | None
    )
    simulated_seconds: float
    wall_seconds: float
    stimulus: Literal["trajectory", "experiment"]
    title: str
    shows: str | None
    citation: str | None
    model: Annotated[
        dict[str, Any],
        Meta(
            extra_json_schema={"required": ["kind"]},
            description="a model of the catalogue: its kind and its parameters",
        ),
    ]
    depth_of: str | None
    judged: bool
    scene: SceneEntry
    closed_form: str | None
    ended: Ended | None
    error: Problem | None
    refusal: Refusal | None
    replay: Replay | None = None
    step_seconds: float | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.model.get("kind"), str):
            raise ValueError("the model has no kind")

    @property
    def key(self) -> RunKey:
        """Suite, case and renderer."""
        return self.suite, self.case, self.renderer

    @property
    def ended_words(self) -> str:
        """When and why it ended before its time, in one sentence; "" where it did not."""
        if self.ended is None:
            return ""
        why = f" ({self.ended.why})" if self.ended.why else ""
        return f"ended early at t = {self.ended.time:.4g} s, tick {self.ended.tick}: {self.ended.what}{why}"

    def lost(self, verdict: VerdictEntry) -> bool:
        """Return whether a verdict of this run is an error since what it needs of it broke; others may be judged."""
        return self.error is not None and verdict.outcome is Outcome.ERROR

    @property
    def is_recorded(self) -> bool:
        """Return whether this is the recorded run of a replay, which no renderer made."""
        return self.replay is not None and self.replay.difference is None

    @property
    def model_parameters(self) -> dict[str, Any]:
        """The model's parameters by name."""
        # A table may hold its parameters flat, or under that name.
        parameters = {name: value for name, value in self.model.items() if name not in ("kind", "sha256")}
        return dict(parameters.get("parameters", parameters))

    def build_model(self, recording: Recording | None) -> Model:
        """Return the model; one that was read from a file is read again, where the `recording` says that it lies.

        Raises `InputError` as `make_model` does, and for a file that is another by now.
        """
        from hapticeval.geometry.catalogue import make_model
        from hapticeval.recordings.provenance import model_of

        parameters = dict(self.model_parameters)
        digest = self.model.get("sha256")
        if digest is not None:
            # The entry has the file's bare name; the recording has its path on the machine that ran it.
            recorded_model = None if recording is None else model_of(recording)
            file = Path(str((recorded_model or {}).get("file", self.model["file"])))
            # With another content it would be another model than the one that was judged.
            if not file.is_file() or digest_of(file) != digest:
                raise InputError(f"the model's file {file} is gone, or another by now", todo="run the case again")
            parameters["file"] = str(file)
        return make_model(self.model["kind"], **parameters)


class Breakdown(NamedTuple):
    """Runs of one renderer that one error stopped, and the verdicts that are errors for it, `lost_verdicts`."""

    runs: list[RunEntry]
    error: Problem
    lost_verdicts: list[VerdictEntry]

    @property
    def words(self) -> str:
        """Return which renderer broke where, and how many verdicts were lost."""
        first = self.runs[0]
        where = f"{first.suite}/{first.case}" if len(self.runs) == 1 else f"{len(self.runs)} cases"
        return f"{first.renderer} on {where}: {plural(len(self.lost_verdicts), 'verdict')} lost"

    @property
    def checks(self) -> list[str]:
        """Return the names of the checks that could not judge."""
        return list(dict.fromkeys(verdict.check for verdict in self.lost_verdicts))

    @property
    def cases(self) -> list[str]:
        """Return the cases as suite/case; of several, else nothing, since `words` names the one."""
        return [f"{run.suite}/{run.case}" for run in self.runs] if len(self.runs) > 1 else []


class Measure(Entry, frozen=True, kw_only=True):
    """A measured number; None where it was not finite."""

    name: str
    value: float | None
    unit: str


class VerdictEntry(Entry, frozen=True, kw_only=True):
    """A verdict: one check of one run, with what was measured and where.

    - `evidence`: where and when, as time (s), hip and ihip (m), and what else was measured.
    - `bound`, `margin`: in the metric's unit; the margin, bound less metric, is negative for a failure.
    - `known`: the reason that a list of known failures gives for this one, see `hapticeval.runner.known`.
    - `beyond_known`: how it goes beyond the failure on that list.
    - `inherent`: why a failure follows from what the renderer declares.
    - `alike`: other renderers that the suite has failing here.
    """

    renderer: str
    suite: str
    case: str
    check: str
    level: Level
    outcome: Outcome
    metric: Measure | None
    bound: float | None
    margin: float | None
    evidence: dict[str, Any]
    message: str
    published: Outcome | None
    as_expected: bool
    known: str | None = None
    beyond_known: str | None = None
    inherent: str = ""
    alike: list[str] = []

    def __post_init__(self) -> None:
        if self.outcome is Outcome.PASS and self.bound is not None and self.metric is not None:
            value = self.metric.value
            if value is not None and value > self.bound:
                raise ValueError(f"a pass whose {self.metric.name}, {value:g}, is beyond its bound, {self.bound:g}")

    @classmethod
    def of(cls, verdict: Verdict) -> VerdictEntry:
        """Return the entry of a verdict.

        A number that JSON cannot hold becomes None, and `evidence["not_finite"]` then names it, so that an infinite
        metric is never lost without a trace. Raises `InputError`, naming the place, for evidence that JSON cannot hold.
        """
        finding = verdict.finding
        # JSON has neither infinities nor NaN.
        measured, non_finite = without_non_finite(
            plain(
                {
                    "metric": None if finding.metric is None else asdict(finding.metric),
                    "bound": finding.bound,
                    "evidence": finding.evidence,
                },
                "verdict",
            ),
            "verdict",
        )
        # Bound less metric: where that is not finite, one of the two is named already.
        margin = without_non_finite(plain(finding.margin))[0]
        if non_finite:
            measured["evidence"]["not_finite"] = [what.removeprefix("verdict.") for what in non_finite]
        return cls(
            renderer=verdict.renderer,
            suite=verdict.suite,
            case=verdict.case,
            check=verdict.check,
            level=verdict.level,
            outcome=verdict.outcome,
            metric=None if measured["metric"] is None else Measure(**measured["metric"]),
            bound=measured["bound"],
            margin=margin,
            evidence=measured["evidence"],
            message=finding.message,
            published=verdict.published,
            as_expected=verdict.as_expected,
            inherent=verdict.inherent,
            alike=list(verdict.alike),
        )

    @property
    def key(self) -> RunKey:
        """Suite, case and renderer: the run that was judged."""
        return self.suite, self.case, self.renderer

    @property
    def time(self) -> float | None:
        """The time, s, that the evidence names; None where it names none."""
        time: Any = self.evidence.get("time")
        return float(time) if type(time) in (int, float) else None

    @property
    def place(self) -> str:
        """Suite, case and check, as `suite/case/check`."""
        return f"{self.suite}/{self.case}/{self.check}"

    @property
    def measured(self) -> str:
        """Metric and bound, lengths in mm, for instance `IHIP jump = 4.1 mm, bound 0.1 mm`; "" where there is none.

        A failure that is worse than the known one says so as well.
        """
        metric, texts = self.metric, []
        if metric is not None and metric.value is not None:
            texts = [f"{metric.name} = {format_quantity(metric.value, metric.unit)}"]
            texts += [] if self.bound is None else [f"bound {format_quantity(self.bound, metric.unit)}"]
        return ", ".join([*texts, *([self.beyond_known] if self.beyond_known else [])])

    @property
    def felt(self) -> float:
        """How much of it a hand feels, N: lengths at `FELT_STIFFNESS`, angles and shares of the force there; else 0."""
        if self.metric is None:
            return 0.0
        # None was not finite, which is worse than any number.
        value = math.inf if self.metric.value is None else abs(self.metric.value)
        force, depth = (self.evidence.get(name) for name in ("force_N", "depth_m"))
        if self.metric.unit in ("", "deg") and isinstance(force, int | float):
            # An angle turns the force by its chord.
            return float(force) * (2.0 * math.sin(math.radians(min(value, 180.0)) / 2.0) if self.metric.unit else value)
        depths = depth if isinstance(depth, int | float) else 0.0
        return value * {"N": 1.0, "m": FELT_STIFFNESS, "depths": FELT_STIFFNESS * depths}.get(self.metric.unit, 0.0)

    @property
    def severity(self) -> tuple[bool, float, float]:
        """Return a key to sort failures by: errors are the worst, then what is felt most, then the most bounds."""
        over = 0.0
        if self.metric is not None and self.bound is not None:
            # None was not finite, which is worse than any number.
            value = math.inf if self.metric.value is None else self.metric.value
            # How many bounds the metric is. A bound of zero has no multiples: then its own size counts.
            over = value / self.bound if self.bound > 0.0 else value
        return self.outcome is Outcome.ERROR, self.felt, over

    @property
    def standing(self) -> Standing:
        """What the verdict amounts to: its outcome compared with what was expected."""
        return standing_of(
            self.outcome,
            level=self.level,
            published=self.published,
            as_expected=self.as_expected,
            known=self.known is not None,
            inherent=bool(self.inherent),
        )

    def stops(self, *, strict: bool) -> bool:
        """Return whether the verdict stops a gate."""
        return self.standing.stops_strict if strict else self.standing.unexpected


class ResultsDocument(Entry, frozen=True, kw_only=True, omit_defaults=False, dict=True):
    """Everything that a report needs to know of a run.

    - `planned`, `ran`: numbers of verdicts; a run that is not `complete` has a `reason`.
    - `runs`: one entry per suite, case and renderer; `verdicts`: one per check of it.
    - `table`, `published_table`: the summary table as it was measured here, and as it is in print.
    - `date`: when the run began (ISO 8601, UTC), "" where unknown.
    - `commits`: for each renderer whose source lies in a git repository, its commit.
    """

    format_version: Literal[1] = FORMAT_VERSION
    planned: Count
    ran: Count
    complete: bool
    reason: str | None
    environment: Environment
    seed: int
    command: Command
    runs: list[RunEntry]
    verdicts: list[VerdictEntry]
    table: Table
    timing: Timing
    published_table: Table = {}
    suites: list[SuiteEntry] = []
    date: str = ""
    commits: dict[str, str] = {}

    def __post_init__(self) -> None:
        if not self.complete and not self.reason:
            raise ValueError("it is incomplete and gives no reason")
        if self.ran > self.planned or (self.complete and self.ran != self.planned):
            state = "complete" if self.complete else "incomplete"
            raise ValueError(
                f"{self.ran:,} of {self.planned:,} planned verdicts ran, and it is {state}: a complete run has as many "
                "verdicts as were planned, and no run has more"
            )
        if self.ran != len(self.verdicts):
            raise ValueError(f"{self.ran} verdicts ran, and it holds {len(self.verdicts)}: one was lost, or added")
        for place, count in Counter((*verdict.key, verdict.check) for verdict in self.verdicts).items():
            if count > 1:
                raise ValueError(f"it holds {count} verdicts of {'/'.join(place)}: a run has one")

    def suite_label(self, name: str) -> str:
        """Return the name of a suite with its version, as it is cited: thesis 1.0."""
        return next((suite.label for suite in self.suites if suite.name == name), name)

    def entries(self) -> Iterator[RunEntry | VerdictEntry]:
        """Yield all runs, then all verdicts."""
        yield from self.runs
        yield from self.verdicts

    @cached_property
    def renderers(self) -> list[str]:
        """Every renderer, in the order in which they ran."""
        tables = (name for row in self.table.values() for name in row)
        return list(dict.fromkeys([*(entry.renderer for entry in self.entries()), *tables]))

    @cached_property
    def verdicts_of(self) -> dict[RunKey, list[VerdictEntry]]:
        """The verdicts of each run."""
        verdicts_by_run: dict[RunKey, list[VerdictEntry]] = {}
        for verdict in self.verdicts:
            verdicts_by_run.setdefault(verdict.key, []).append(verdict)
        return verdicts_by_run

    @property
    def all_refused(self) -> bool:
        """Return whether every renderer refused every case: nothing was judged. A recorded run is not a renderer."""
        runs = [run for run in self.runs if not run.is_recorded]
        return bool(runs) and all(run.refusal for run in runs)

    def lost(self, verdict: VerdictEntry) -> bool:
        """Return whether a verdict is lost to its run, see `RunEntry.lost`: `breakdowns` has these together."""
        return verdict.key in self._broken and self._broken[verdict.key].lost(verdict)

    @cached_property
    def _broken(self) -> dict[RunKey, RunEntry]:
        return {run.key: run for run in self.runs if run.error}

    @cached_property
    def breakdowns(self) -> list[Breakdown]:
        """Renderers that broke: one entry for each renderer and error, in the order of the runs."""
        breakdown_by_cause: dict[tuple[str, tuple[str, str]], Breakdown] = {}
        for run in self.runs:
            if run.error is not None:
                # One cause: the same error but for numbers and places.
                key = run.renderer, run.error.kind
                runs, error, before = breakdown_by_cause.get(key, Breakdown([], run.error, []))
                lost_verdicts = filter(run.lost, self.verdicts_of.get(run.key, []))
                breakdown_by_cause[key] = Breakdown([*runs, run], error, [*before, *lost_verdicts])
        return list(breakdown_by_cause.values())

    @cached_property
    def table_notes(self) -> list[str]:
        """What a Yes of the summary table leaves open: a tool that jumps nowhere may still not follow the hand."""
        off_normal = Counter(
            verdict.renderer
            for verdict in self.verdicts
            if verdict.check == "contact-normal-force"
            and verdict.outcome is Outcome.FAIL
            and verdict.standing.unexpected
        )
        cells = {title: places for suite in self.suites for title, places in suite.cells.items()}
        about_jumps = [
            title for title, places in cells.items() if any("/continuous-contact" in place for place in places)
        ]
        notes = []
        for renderer, count in off_normal.items():
            resisted = [title for title in about_jumps if self.table.get(title, {}).get(renderer) == "Yes"]
            if resisted:
                rows = "' and '".join(resisted)
                notes.append(
                    f"{renderer}: Yes for '{rows}' says that its tool jumps nowhere, not that it follows the hand: "
                    f"contact-normal-force fails in {plural(count, 'case')}"
                )
        return notes

    @cached_property
    def refusals(self) -> dict[tuple[str, str], list[str]]:
        """The suite/case that renderers refused, by renderer and reason."""
        places: dict[tuple[str, str], list[str]] = {}
        for run in self.runs:
            if run.refusal is not None:
                places.setdefault((run.renderer, run.refusal.what), []).append(f"{run.suite}/{run.case}")
        return places

    def stops(self, verdict: VerdictEntry) -> bool:
        """Return whether a verdict stops the gate of this run."""
        return verdict.stops(strict=self.command.strict)

    @cached_property
    def stopping(self) -> list[VerdictEntry]:
        """The verdicts that stop the gate of this run: what is not as expected, and with --strict more."""
        return [verdict for verdict in self.verdicts if self.stops(verdict)]

    @cached_property
    def stopping_by_itself(self) -> list[VerdictEntry]:
        """Those of `stopping` that are not lost to a run that broke."""
        return [verdict for verdict in self.stopping if not self.lost(verdict)]

    @property
    def strict_words(self) -> str:
        """Which of `stopping` would not stop a gate that is not strict, behind their number; "" where there is none."""
        strict_only = [verdict.standing for verdict in self.stopping if not verdict.standing.unexpected]
        return f" (by --strict: {counts_in_words(strict_only)})" if strict_only else ""


def results_schema() -> dict[str, Any]:
    """Return the JSON schema of results.json."""
    return msgspec.json.schema(ResultsDocument)


def write_results(directory: Path, results: ResultsDocument) -> Path:
    """Write `directory`/results.json, whole or not at all, and return its path; null stands for non-finite numbers.

    Raises `InputError` for results that `read_results` would not take, and `HapticevalError` where the file cannot be
    written.
    """
    return write_json(Path(directory) / RESULTS_FILE, results)


def read_results(directory: Path) -> ResultsDocument:
    """Read `directory`/results.json.

    Raises `InputError`, naming file and place, for a folder or file that is not there, JSON that is broken, a
    format version other than ours, and a document that does not fit the types.
    """
    return read_json(Path(directory) / RESULTS_FILE, ResultsDocument, version=FORMAT_VERSION, command="run")


def unknown_renderer(name: str, known: Iterable[str]) -> UnknownNameError:
    """Return the error of a renderer that results are asked for and that is not among those that they know."""
    error = UnknownNameError("renderer of these results", name, known)
    error.todo += (
        "; to have others beside them, judge all of them in one run (-r A -r B), or join two folders by "
        "`hapticeval merge`"
    )
    return error


def environment() -> dict[str, Any]:
    """Return what the numbers may depend on: versions and the kind of machine, no names of hosts, users or folders."""
    # Packages whose version may change a digit.
    names = ("hapticeval", "numpy", "scipy", "numba", "shapely", "h5py")
    return {
        "python": platform.python_version(),
        "platform": platform.platform(),
        "cpu_count": os.cpu_count(),
        "versions": {name: _version_of(name) for name in names},
    }


@cache
def _version_of(package: str) -> str | None:
    """Return the version of what is installed, or None: it is looked for once (2 ms) and stays while a process runs."""
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return None
