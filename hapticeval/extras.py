"""What installed packages register, and what to type for the libraries of an extra.

That is never by the name of this package alone, which an index may not have.
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Iterable
from functools import lru_cache
from importlib.metadata import EntryPoint, distributions, entry_points
from urllib.parse import unquote, urlparse

PACKAGE = "hapticeval"


def entries_of(group: str) -> tuple[EntryPoint, ...]:
    """Return the entry points of a group, of all installed packages, in the order of `sys.path`."""
    return _entries_in(tuple(sys.path), group)


@lru_cache(maxsize=16)
def _entries_in(folders: tuple[str, ...], group: str) -> tuple[EntryPoint, ...]:  # noqa: ARG001
    # Looked through once (20 ms) for a sys.path: a test or a notebook that adds a folder sees its entry points too.
    return tuple(entry_points(group=group))


def by_name(entries: Iterable[EntryPoint]) -> dict[str, EntryPoint]:
    """Return entry points by name, in alphabetical order; of two of a name the last."""
    return {entry.name: entry for entry in sorted(entries, key=lambda entry: entry.name)}


def install_command(extra: str) -> str:
    """Return the command that adds the libraries of an extra to this installation.

    Of a checkout it names the folder, of a wheel the libraries themselves: so pip never looks this package up in an
    index, where anybody may have taken its name.
    """
    installations = list(distributions(name=PACKAGE))
    if not installations:  # run from the source alone
        return f"pip install '.[{extra}]', in the folder of its pyproject.toml"
    # PEP 610: pip notes where an installation came from. What a build has left in the current folder is none of pip's.
    for installation in installations:
        origin = json.loads(installation.read_text("direct_url.json") or "{}")
        if origin.get("dir_info", {}).get("editable"):
            return f"pip install --editable '{unquote(urlparse(origin['url']).path)}[{extra}]'"
    marker = re.compile(rf"; *extra *== *['\"]{re.escape(extra)}['\"]")
    requirements = [marker.split(line)[0].strip() for line in installations[0].requires or () if marker.search(line)]
    return "pip install " + " ".join(f"'{requirement}'" for requirement in requirements)
