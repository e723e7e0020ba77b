"""What is the same for the same seed, in every program: numbers made of small whole ones, and examples as a list."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from tempfile import TemporaryDirectory
from typing import TypeVar

from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import seed as seeded
from hypothesis import strategies as st
from hypothesis.configuration import set_hypothesis_home_dir, storage_directory

from hapticeval.errors import InputError


def rounded(value: float, size: float) -> float:
    """Return a length (m) rounded to about 5e-6 of `size` (m), so that it can be read and pasted."""
    # five decimals after the first digit of the size
    return round(float(value), 5 - math.floor(math.log10(size)))


def share() -> st.SearchStrategy[float]:
    """Draw 0, 0.01, ..., 0.99."""
    return st.integers(0, 99).map(lambda percent: percent / 100.0)


def signed() -> st.SearchStrategy[float]:
    """Draw -0.99, ..., 0.99; smaller ones are simpler."""
    return st.integers(-99, 99).map(lambda percent: percent / 100.0)


def sizes() -> st.SearchStrategy[float]:
    """Draw a size of a model, m."""
    return st.sampled_from([0.2, 0.1, 0.05, 0.4])


T = TypeVar("T")


def examples(strategy: st.SearchStrategy[T], count: int, *, seed: int = 0) -> list[T]:
    """Return up to `count` different examples of a strategy: the same for the same seed and version of hypothesis.

    Fewer where it has no more. They depend neither on a clock, nor on what is loaded, nor on earlier examples.
    """
    if not isinstance(count, int) or count < 1:
        raise InputError(f"count = {count!r}", why="it is a whole number of examples, and positive")
    collected: list[T] = []

    @seeded(seed)
    @settings(
        # neither earlier failures nor shrinking: nothing but the seed decides
        max_examples=count, phases=[Phase.generate], database=None, deadline=None, derandomize=False,
        suppress_health_check=list(HealthCheck),
    )  # fmt: skip
    @given(strategy)
    def collect(example: T) -> None:
        collected.append(example)

    with _temporary_caches():
        collect()
    return collected[:count]


@contextmanager
def _temporary_caches() -> Iterator[None]:
    """Have hypothesis keep its caches in a folder that is removed, unless it has one already."""
    home = storage_directory(intent_to_write=False).home_directory
    if home.exists():
        yield
        return
    with TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        set_hypothesis_home_dir(folder)
        try:
            yield
        finally:
            set_hypothesis_home_dir(home)
