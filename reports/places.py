"""Where things stand in a report: the page of a case, and the place of a case, a run or a verdict in a page."""

from __future__ import annotations

from urllib.parse import quote

from hapticeval.files import file_stem

FOLDER = "report"
"""The folder of the pages, beside results.json."""

INDEX = "index.html"
CHECK_PAGES = "checks.html"
ASSETS = "assets"
"""The first page, the page of what checks ask, and the folder of what all pages share, below `FOLDER`."""

ROOT = "../../"
"""From the page of a case to `FOLDER`."""


def anchor(*names: str) -> str:
    """Return the id of `renderer/check` on the page of a case, of `suite/case/renderer/check` on that of all."""
    # Quoted as in a URL, so that the link and the id are the same text.
    return "/".join(quote(name, safe="@+:,~", errors="surrogatepass") for name in names)


def case_file(suite: str, case: str) -> str:
    """Return the path of a case's page below `FOLDER`."""
    return f"cases/{file_stem(suite)}/{file_stem(case)}.html"
