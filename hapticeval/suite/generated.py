"""Trajectories that hypothesis draws: `trajectory = { kind = "generated", strategy = "hand", seed = 3 }`."""

from __future__ import annotations

import math
from functools import lru_cache
from itertools import pairwise
from pathlib import Path as FilePath
from typing import Annotated, Any, Literal

from msgspec import Meta

from hapticeval.geometry.boundary import Boundary
from hapticeval.geometry.model import Model
from hapticeval.stimulus.moves import Move, Moves, shortest_duration
from hapticeval.stimulus.paths import Trajectory
from hapticeval.stimulus.stimulus import Path


class Generated(Trajectory, frozen=True, kw_only=True, tag="generated"):
    """A trajectory of random hand paths, one after the other: see `hapticeval.strategies.hand_paths`.

    - `seed`: the same one gives the same path with the same version of hypothesis.
    - `examples`: how many paths; from one to the next the hand goes straight, through the model if need be.
    - `parts`: what paths are made of, all kinds if none are given; `most`: how many parts a path has at most.
    """

    seed: Annotated[int, Meta(ge=0)]
    strategy: Literal["hand", "hand-with-tremor"] = "hand"
    examples: Annotated[int, Meta(ge=1, le=10_000)] = 20
    parts: tuple[str, ...] = ()
    most: int = 3

    def path(self, surface: Boundary, folder: FilePath) -> Path:  # noqa: ARG002 - as every trajectory
        """Return the path, drawn once for a surface; see `Trajectory.path` and `hand_paths`."""
        known: Any = surface
        return _path(self, known)


@lru_cache(maxsize=8)
def _path(table: Generated, surface: Boundary) -> Path:
    from hapticeval import strategies

    # Strategies draw on models, and read nothing of one but its boundary.
    model = Model(surface.name, {}, surface)
    drawn = strategies.hand_paths(
        model, parts=table.parts or strategies.PARTS, most_parts=table.most, tremor=table.strategy == "hand-with-tremor"
    )
    paths = strategies.examples(drawn, table.examples, seed=table.seed)
    moves = list(paths[0].moves)
    for before, after in pairwise(paths):
        # A straight move joins two paths; it is left out where the next starts where this one ended.
        length = math.dist(before.moves[-1].to, after.start)
        moves += [Move(to=after.start, seconds=shortest_duration(length)), *after.moves] if length else after.moves
    tremor = next((path.tremor for path in paths if path.tremor is not None), None)
    return Moves(start=paths[0].start, moves=tuple(moves), tremor=tremor).path()
