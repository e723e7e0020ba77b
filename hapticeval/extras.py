"""What to type for the libraries of an extra: never by the name of this package alone, which an index may not have."""

from __future__ import annotations

import json
import re
from importlib.metadata import distributions
from urllib.parse import unquote, urlparse

PACKAGE = "hapticeval"


def install_command(extra: str) -> str:
    """Return the command that adds the libraries of an extra to this installation.

    For a checkout it names the folder, for a wheel the libraries themselves: so pip never looks this package up in an
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
