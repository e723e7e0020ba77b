"""What mkdocs makes of other files: the README, ARCHITECTURE.md, a page of every check from its own data, and pictures.

Pictures are not kept in the repository: `make docs` runs the pages first, and takes what their commands draw.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files

import hapticeval
from hapticeval.phenomena.registry import CHECKS

ROOT = Path(__file__).parents[1]
PAGES = ROOT / "build" / "pages"
"""Where the pages were run."""

SOURCE = re.compile(r"\[([^\]]+)\]\(\.\./[^)]+\)")


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the generated pages."""
    readme = (ROOT / "README.md").read_text(encoding="utf-8").replace("](docs/", "](")
    pages = {
        "index.md": linked(readme),
        "architecture.md": (ROOT / "ARCHITECTURE.md").read_text(encoding="utf-8"),
        "contributing.md": (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8").replace("](docs/", "]("),
        "changelog.md": (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"),
        "checks.md": "\n".join(checks()),
        "api.md": "\n".join(reference()),
    }
    for name, content in pages.items():
        files.append(File.generated(config, name, content=content))
    for drawn in sorted(PAGES.glob("*/pictures/*.svg")):
        files.append(File.generated(config, f"pictures/{drawn.name}", abs_src_path=str(drawn)))
    return files


def linked(readme: str) -> str:
    """Return the README with links to the site's pages."""
    for name in ("CHANGELOG", "ARCHITECTURE", "CONTRIBUTING"):
        readme = readme.replace(f"]({name}.md)", f"]({name.lower()}.md)")
    return readme


def on_page_markdown(markdown: str, **_: object) -> str:
    """Turn links to the README into links to the first page; other files of the repository are named without one."""
    return SOURCE.sub(r"\1", markdown.replace("](../README.md", "](index.md"))


def checks() -> Iterator[str]:
    """Yield a page: each check with its question, formula, bound, and the part of the thesis that it is from."""
    yield "# Every check"
    yield "\nAs `hapticeval explain CHECK` prints it. A metric up to the bound passes."
    yield "The pictures show a renderer that passes, and below it one that was broken to fail, in the same case."
    for name, check in CHECKS.items():
        yield f"\n## {name}\n\n{check.asks}\n"
        rows = {
            "phenomenon": check.phenomenon,
            "formula": check.formula,
            "metric": f"{check.metric} ({check.unit})" if check.unit else check.metric,
            "bound": check.bound,
            "level": check.level.value,
            "source": check.citation,
            "reads": ", ".join(check.channels),
        }
        yield from (f"**{title}** {escaped(text)}\n" for title, text in rows.items() if text)
        for word in ("passes", "fails"):
            drawn = f"pictures/check-{name}-{word}.svg"
            if (PAGES / "checks.py" / drawn).exists():
                yield f"![A renderer that {word} {name}.]({drawn})\n"


def reference() -> Iterator[str]:
    """Yield a page of every public name of the package, from its docstrings."""
    yield "# Reference"
    for name in hapticeval.__all__:
        module = hapticeval._LAZY.get(name)
        if module is not None:
            yield f"\n::: {module}.{name}"


def escaped(text: str) -> str:
    """Return text in which markdown finds nothing to set."""
    return re.sub(r"([*_|<\[\]])", r"\\\1", text)
