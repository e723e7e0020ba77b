"""The results of several runs made one: of the shards of a plan, or of runs that asked different things."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TypeVar

import msgspec

from hapticeval.errors import HapticevalError, InputError
from hapticeval.files import replacing
from hapticeval.runner.planning import Shard
from hapticeval.runner.progress import fill_table, timing
from hapticeval.runner.results import (
    Command,
    Environment,
    ResultsDocument,
    RunKey,
    SuiteEntry,
    Table,
    read_results,
    write_results,
)
from hapticeval.runner.resuming import Outcomes, differing_versions

T = TypeVar("T")

SHOWN_NAMES = 5
"""How many of a list of names a message shows."""


def merge_into(folders: Sequence[Path], directory: Path) -> ResultsDocument:
    """Write the results of `folders` into `directory` as those of one run, recordings included, and return them.

    Runs and verdicts come in the order in which one run would have come to them. What is incomplete stays incomplete.

    Raises `InputError`, with the names, where results differ in versions, seed or strictness, where two have the same
    run, where a suite is not the same in all, and where shards are missing.
    """
    if directory.resolve() in {folder.resolve() for folder in folders}:
        raise InputError(f"'{directory}' is one of the folders to merge", todo="name another with -o")
    document_by_folder = {str(folder): read_results(folder) for folder in dict.fromkeys(folders)}
    if len(document_by_folder) != len(folders):
        raise InputError("a folder is named twice", todo="name each once")
    results = merge_results(document_by_folder)
    shutil.rmtree(directory / "recordings", ignore_errors=True)  # of earlier results in the folder
    Outcomes(directory).forget()
    for folder, document in document_by_folder.items():
        for run in document.runs:
            if run.recording is not None:
                _bring(Path(folder) / run.recording, directory / run.recording)
    write_results(directory, results)
    return results


def merge_results(document_by_folder: Mapping[str, ResultsDocument]) -> ResultsDocument:
    """Return the results of several folders, by their names, as one: see `merge_into`."""
    if not document_by_folder:
        raise InputError("no results are named", todo="name the folders of runs")
    first = next(iter(document_by_folder.values()))
    _refuse_unlike(document_by_folder)
    _refuse_overlap(document_by_folder)
    _refuse_missing_shards(document_by_folder)
    suites = _suites(document_by_folder)
    # The order in which one run would have come to them; what no suite lists comes last.
    planned = ((suite.name, case, name) for suite in suites for case in suite.cases for name in suite.renderers)
    place = {key: at for at, key in enumerate(planned)}
    documents = list(document_by_folder.values())
    runs = sorted(
        (run for document in documents for run in document.runs), key=lambda run: place.get(run.key, len(place))
    )
    verdicts = sorted(
        (verdict for document in documents for verdict in document.verdicts),
        key=lambda verdict: place.get(verdict.key, len(place)),
    )
    reasons = [f"{name}: {document.reason}" for name, document in document_by_folder.items() if not document.complete]
    published: Table = {}
    for document in documents:
        for title, row in document.published_table.items():
            published.setdefault(title, {}).update(row)
    return ResultsDocument(
        planned=sum(document.planned for document in documents),
        ran=len(verdicts),
        complete=not reasons,
        reason="; ".join(reasons) or None,
        environment=Environment(
            python=first.environment.python,
            # alike in versions, the machines may still differ in name
            platform=", ".join(_union([document.environment.platform] for document in documents)),
            cpu_count=first.environment.cpu_count,
            versions=first.environment.versions,
        ),
        seed=first.seed,
        command=Command(
            suites=[suite.name for suite in suites],
            renderers=_union(document.command.renderers for document in documents),
            select=_union(document.command.select for document in documents),
            strict=first.command.strict,
        ),
        runs=runs,
        verdicts=verdicts,
        table=fill_table(suites, verdicts),
        published_table=published,
        suites=suites,
        date=min(document.date for document in documents),
        commits={name: commit for document in documents for name, commit in document.commits.items()},
        timing=timing(runs, sum(document.timing.wall_seconds for document in documents)),
    )


def _bring(source: Path, target: Path) -> None:
    """Link the file `source` to `target` as well where the file system can, else copy it. Raises `HapticevalError`."""
    try:
        with replacing(target) as temporary:
            try:
                os.link(source, temporary)
            # The recording itself is missing: a copy would fail as well.
            except FileNotFoundError:
                raise
            # Another file system, or one without links.
            except OSError:
                shutil.copyfile(source, temporary)
    except OSError as error:
        raise HapticevalError(
            f"cannot bring the recording {source} to {target}",
            why=error.strerror or str(error),
            todo="bring the whole folder of each run, its recordings included",
        ) from error


def _refuse_unlike(document_by_folder: Mapping[str, ResultsDocument]) -> None:
    """Raise `InputError` where two results differ in what a verdict may depend on."""
    (name, first), *others = document_by_folder.items()
    for other, document in others:
        differs = differing_versions(first.environment, document.environment, then=" and")
        if document.seed != first.seed:
            differs.append(f"seed {first.seed} and {document.seed}")
        if document.command.strict != first.command.strict:
            differs.append("only one of both runs is strict")
        if differs:
            raise InputError(
                f"the results in '{name}' and '{other}' are not of one run",
                why="; ".join(differs),
                todo="run one of them again with the versions and arguments of the other",
            )


def _refuse_overlap(document_by_folder: Mapping[str, ResultsDocument]) -> None:
    """Raise `InputError` where two results have a run of the same suite, case and renderer."""
    folder_by_run: dict[RunKey, str] = {}
    for name, document in document_by_folder.items():
        shared_runs = [run.key for run in document.runs if run.key in folder_by_run]
        if shared_runs:
            suite, case, renderer = shared_runs[0]
            more = f" and {len(shared_runs) - 1} more" if len(shared_runs) > 1 else ""
            raise InputError(
                f"'{folder_by_run[shared_runs[0]]}' and '{name}' overlap",
                why=f"both hold {renderer} on {suite}/{case}{more}",
                todo="name one of them, or runs that share nothing",
            )
        folder_by_run |= dict.fromkeys((run.key for run in document.runs), name)


def _refuse_missing_shards(document_by_folder: Mapping[str, ResultsDocument]) -> None:
    """Raise `InputError` where only some of the shards of one run are there."""
    shards_by_question: dict[bytes, dict[Shard, str]] = {}
    for name, document in document_by_folder.items():
        if document.command.shard is None:
            continue
        shard = Shard.parse(document.command.shard)
        # Shards are of one run where all that was asked is the same but for their own number.
        question = msgspec.json.encode(
            [shard.count, msgspec.structs.replace(document.command, shard=None), document.suites]
        )
        shards_by_question.setdefault(question, {})[shard] = name
    for shards in shards_by_question.values():
        count = next(iter(shards)).count
        missing = [str(part) for number in range(1, count + 1) if (part := Shard(number, count)) not in shards]
        if missing:
            present = ", ".join(f"{shard} in '{name}'" for shard, name in sorted(shards.items())[:SHOWN_NAMES])
            raise InputError(
                f"shards are missing: {', '.join(missing)}",
                why=f"of {count} there are {len(shards)}: {present}{', ...' if len(shards) > SHOWN_NAMES else ''}",
                todo="name the folders of all of them; a shard that was killed goes on with --resume",
            )


def _suites(document_by_folder: Mapping[str, ResultsDocument]) -> list[SuiteEntry]:
    """Return each suite once, with what was planned of it in any of the runs."""
    folder_and_suite: dict[str, tuple[str, SuiteEntry]] = {}
    for name, document in document_by_folder.items():
        for suite in document.suites:
            if suite.name not in folder_and_suite:
                folder_and_suite[suite.name] = name, suite
                continue
            first_folder, before = folder_and_suite[suite.name]
            # Verdicts on different questions must not stand in one table under one name.
            if before.digest != suite.digest:
                raise InputError(
                    f"the suite '{suite.name}' is not the same in '{first_folder}' and '{name}'",
                    why="it was changed between the runs, or two suites have that name",
                    todo="run one of them again, or rename one of the suites",
                )
            cases, renderers = (
                _union([getattr(before, what), getattr(suite, what)]) for what in ("cases", "renderers")
            )
            folder_and_suite[suite.name] = (
                first_folder,
                msgspec.structs.replace(before, cases=cases, renderers=renderers),
            )
    return [suite for _, suite in folder_and_suite.values()]


def _union(lists: Iterable[Sequence[T]]) -> list[T]:
    """Return the entries of all lists, once each, in the order in which they first appear."""
    return list(dict.fromkeys(entry for entries in lists for entry in entries))
