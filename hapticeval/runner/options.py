"""The options of a run: what is chosen of its suites, what stops a gate, and who does the jobs; checked once, here."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from hashlib import sha256
from pathlib import Path
from typing import Any, Protocol, TypeVar

from hapticeval.errors import InputError, NothingSelectedError, UnknownNameError
from hapticeval.runner.results import RunKey


class Keyed(Protocol):
    """Anything that has the suite, case and renderer of a job."""

    @property
    def key(self) -> RunKey:
        """Suite, case and renderer."""
        ...


T = TypeVar("T", bound=Keyed)


@dataclass(frozen=True, order=True)
class Shard:
    """Part `number` of `count`, counted from 1."""

    number: int
    count: int

    @classmethod
    def parse(cls, text: str) -> Shard:
        """Return the shard of a text as 3/16. Raises `InputError` for any other."""
        match = re.fullmatch(r"([1-9]\d*)/([1-9]\d*)", text)
        if match is None or int(match[1]) > int(match[2]):
            raise InputError(
                f"--shard {text}", why="it is the number of a part and how many there are", todo="write 3/16, 1/1"
            )
        return cls(int(match[1]), int(match[2]))

    def __str__(self) -> str:
        return f"{self.number}/{self.count}"

    def of(self, jobs: Sequence[T]) -> tuple[T, ...]:
        """Return the jobs of this shard, in the order of the plan.

        Jobs are dealt out by turns in the order of a digest of their names: shards differ by one job at most, and none
        has all the jobs of a slow renderer. Raises `NothingSelectedError` where none is left for it.
        """
        if self.number > len(jobs):
            raise NothingSelectedError(
                f"shard {self} is empty", why=f"there are {len(jobs)} jobs", todo="make fewer shards"
            )
        # A digest orders as if at random, and the same everywhere: neighbours in the plan go to different shards.
        dealt_order = sorted(range(len(jobs)), key=lambda at: _digest(jobs[at].key))
        return tuple(jobs[at] for at in sorted(dealt_order[self.number - 1 :: self.count]))


def _digest(key: RunKey) -> bytes:
    return sha256("\0".join(key).encode()).digest()


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
        return cls(
            **{
                name: OPTION_READERS[name](value) if name in OPTION_READERS else value
                for name, value in options.items()
            }
        )


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


OPTION_READERS: Mapping[str, Callable[[Any], Any]] = {
    "select": lambda value: as_tuple(value, "select", (str,)),
    "known": _read_path,
    "output": _read_path,
    "shard": lambda value: Shard.parse(value) if isinstance(value, str) else value,
}
"""How an option that a user writes as text or as a list becomes its value."""
