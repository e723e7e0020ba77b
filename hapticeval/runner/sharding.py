"""Shards, parts of a plan for several runs: together they do each of its jobs once."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from hashlib import sha256
from typing import Protocol, TypeVar

from hapticeval.errors import InputError, NothingSelectedError
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
