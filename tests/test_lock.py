"""`make lock` writes what pyproject.toml asks for into constraints.txt, and nothing of the machine on which it runs."""

from __future__ import annotations

import tomllib
from itertools import chain
from pathlib import Path

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).parents[1]
LOCKED = [
    Requirement(line)
    for line in (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines()
    if not line.startswith("#")
]


def test_each_library_that_is_asked_for_is_locked_within_its_range():
    text = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    build, project = (tomllib.loads(text)[table] for table in ("build-system", "project"))
    asked_for = [*build["requires"], *project["dependencies"], *chain(*project["optional-dependencies"].values())]
    for asked in map(Requirement, asked_for):
        versions = [
            pin.version
            for locked in LOCKED
            if canonicalize_name(locked.name) == canonicalize_name(asked.name)
            for pin in locked.specifier
        ]
        assert versions, f"constraints.txt has no {asked.name}: run make lock"
        assert all(version in asked.specifier for version in versions), f"{asked} and {versions} differ: run make lock"


def test_the_lock_has_names_with_one_version_and_markers_alone():
    for locked in LOCKED:
        assert [pin.operator for pin in locked.specifier] == ["=="], locked
        assert locked.url is None, locked
