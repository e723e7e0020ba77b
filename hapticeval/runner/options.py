"""The options of a run: what is chosen of its suites, what stops a gate, and who does the jobs; checked once, here."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from hapticeval.errors import InputError, UnknownNameError
from hapticeval.runner.sharding import Shard


@dataclass(frozen=True, kw_only=True)
class RunOptions:
    """The options of a run, whoever begins it: the command line, Python or pytest.

    What is run:

    - `select`: expressions over names of cases and checks, see `suite.selection`; any of them selects.
    - `quick`: few of the selected cases, which have every check between them.
    - `shard`: the part of all this that is run, see `api.merge`.
    - `seed`: of it each job's own is made.

    What stops a gate, and the run:

    - `strict`: warnings count too.
    - `known`: a file of known failures, see `runner.known`.
    - `exit_first`: end at the first verdict that stops a gate.
    - `failed_first`: begin with what did so in the results that `output` holds.

    How it is done; no verdict depends on these:

    - `output`: the folder for results.json and the recordings; None to write nothing.
    - `resume`: keep what an earlier run into `output` has finished.
    - `workers`: how many processes share the jobs, one for each processor if None; with 0 this one does them.
    - `timeout`: seconds after which a job is ended, its verdicts errors; not in this process.
    - `scheduler`: the address of a dask scheduler whose workers do the jobs.

    Raises `InputError` for a number that is out of its range, and for `resume` without `output`.
    """

    select: tuple[str, ...] = ()
    quick: bool = False
    shard: Shard | None = None
    seed: int = 0
    strict: bool = False
    known: Path | None = None
    exit_first: bool = False
    failed_first: bool = False
    output: Path | None = None
    resume: bool = False
    workers: int | None = None
    timeout: float = math.inf
    scheduler: str | None = None

    def __post_init__(self) -> None:
        for name, value in (("seed", self.seed), ("workers", 0 if self.workers is None else self.workers)):
            if not isinstance(value, int) or value < 0:
                raise InputError(f"{name} = {value!r}", why="it is a whole number, and not negative")
        if not self.timeout > 0.0:
            raise InputError(f"timeout = {self.timeout!r}", why="it is seconds that a case may take, and positive")
        if self.resume and self.output is None:
            raise InputError("there is nothing to resume", why="results lie in no folder", todo="name one: output=...")

    @classmethod
    def of(cls, **options: Any) -> RunOptions:
        """Return the options as a user writes them: one expression or several, paths and the shard "3/16" as text.

        Raises `UnknownNameError` for an option that is none of these, and `InputError` for a value that it cannot be.
        """
        names = [option.name for option in fields(cls)]
        for name in options:
            if name not in names:
                raise UnknownNameError("option", name, names)
        return cls(**{name: READ[name](value) if name in READ else value for name, value in options.items()})


DEFAULT_OPTIONS = RunOptions()


def as_tuple(values: Any, what: str, kinds: tuple[type, ...]) -> tuple[Any, ...]:
    """Return one or several as a tuple. Raises `InputError` for what is of none of the `kinds`."""
    listed = tuple(values) if isinstance(values, list | tuple | set | frozenset) else (values,)
    for value in listed:
        if not isinstance(value, kinds):
            raise InputError(f"{what}: {value!r}", why=f"it is no {' or '.join(kind.__name__ for kind in kinds)}")
    return listed


def _read_path(value: str | Path | None) -> Path | None:
    return None if value is None else Path(value)


READ: Mapping[str, Callable[[Any], Any]] = {
    "select": lambda value: as_tuple(value, "select", (str,)),
    "known": _read_path,
    "output": _read_path,
    "shard": lambda value: Shard.parse(value) if isinstance(value, str) else value,
}
"""How an option that a user writes as text or as a list becomes its value."""
