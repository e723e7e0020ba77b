"""The commit of the repository that a renderer's source lies in, so that a report can be traced to the code."""

from __future__ import annotations

import subprocess
import sys
from functools import cache
from pathlib import Path
from typing import Any

from hapticeval.discovery import known_renderers, load, parse
from hapticeval.errors import HapticevalError
from hapticeval.runner.planning import Plan

PATIENCE = 5.0
"""Seconds that git has for an answer."""


def commits(plan: Plan) -> dict[str, str]:
    """Return the commit of each renderer's repository, followed by "-dirty" where files differ from it.

    Renderers whose source is no file that a repository tracks, as an installed package's, are left out.
    """
    factories = {job.renderer: job.factory for job in plan.jobs}
    commit_by_renderer = {
        name: _commit(file) for name in plan.renderers if (file := _source(name, factories.get(name))) is not None
    }
    return {name: commit for name, commit in commit_by_renderer.items() if commit}


def _source(name: str, factory: Any) -> Path | None:
    """Return the source file of a renderer, by its name or by its `factory`; None where there is none."""
    if factory is not None:
        module = getattr(factory, "__module__", "")
    else:
        base = parse(name).base
        try:
            load(base)
        except HapticevalError:  # no renderer, as the recorded run of a replay
            return None
        # `package.module:factory` names its module; any other name is an entry point, which does.
        module = (base if ":" in base else known_renderers()[base].value).partition(":")[0].strip()
    file = getattr(sys.modules.get(module), "__file__", None)
    return None if file is None else Path(file).resolve()


@cache
def _commit(file: Path) -> str:
    """Return the commit of the repository that tracks a file, "" where none does."""
    # A file that no commit holds has none, even inside of a repository.
    if not _git(file.parent, "ls-files", "--", file.name):
        return ""
    return _git(file.parent, "describe", "--always", "--dirty", "--abbrev=40", "--exclude=*")


def _git(folder: Path, *words: str) -> str:
    """Return what git prints, "" where there is no git, no repository, or no answer in time."""
    try:
        done = subprocess.run(
            ["git", "-C", str(folder), *words], capture_output=True, text=True, timeout=PATIENCE, check=False
        )
    except (OSError, subprocess.SubprocessError):
        return ""
    return done.stdout.strip() if done.returncode == 0 else ""
