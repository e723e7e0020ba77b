"""What mkdocs makes of other files: the README, ARCHITECTURE.md, a list of every check, and pictures.

Pictures are not kept in the repository: `make docs` runs the pages first, and takes what their commands draw.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

import hapticeval
from hapticeval.effects.catalogue import EFFECTS
from hapticeval.effects.effect import unit_of
from hapticeval.phenomena.check import Check
from hapticeval.phenomena.pages import read_page
from hapticeval.phenomena.registry import CHECKS

ROOT = Path(__file__).parents[1]
PAGES = ROOT / "build" / "pages"
"""Where the pages were run."""

SOURCE = re.compile(r"\[([^\]]+)\]\(\.\./[^)]+\)")


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the generated pages."""
    readme = (
        (ROOT / "README.md")
        .read_text(encoding="utf-8")
        .replace("](docs/checks)", "](checks.md)")
        .replace("](docs/", "](")
    )
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


def on_page_markdown(markdown: str, page: Page, **_: object) -> str:
    """Turn links to the README into links to the first page; other files of the repository are named without one."""
    if page.file.src_uri == "effects.md":
        markdown = markdown.replace("<!-- the table of effects -->", "\n".join(effects()))
    if page.file.src_uri.startswith("checks/"):
        return with_facts(markdown, CHECKS[Path(page.file.src_uri).stem])
    return SOURCE.sub(r"\1", markdown.replace("](../README.md", "](index.md"))


def checks() -> Iterator[str]:
    """Yield the page that lists every check with its question."""
    yield "# Every check"
    yield "\nA metric up to the bound passes. Each page has the bound with its derivation, what the check does not see,"
    yield "and common causes of a fail. `hapticeval explain CHECK` prints the short of it.\n"
    yield "| check | level | what it asks |\n|---|---|---|"
    for name, check in CHECKS.items():
        yield f"| [{name}](checks/{name}.md) | {check.level.value} | {escaped(read_page(check).question)} |"


def effects() -> Iterator[str]:
    """Yield the table of every effect: what it does, from its docstring, and its numbers with their units."""
    yield "| kind | what it does | numbers |\n|---|---|---|"
    for kind, entry in EFFECTS.items():
        first_sentence = " ".join((entry.of.__doc__ or "").split()).partition(". ")[0]
        said = first_sentence.rstrip(".").removesuffix("; see the module")
        numbers = [
            f"`{number.name}`" + (f" ({unit_of(unit)})" if (unit := number.metadata.get("unit")) else "")
            for number in fields(entry.of)
            if number.compare
        ]
        yield f"| `{kind}` | {escaped(said)} | {', '.join(numbers)} |"


def with_facts(markdown: str, check: Check) -> str:
    """Return the page of a check with its pictures, formula and what else stands in the code, below its question."""
    facts = {
        "formula": f"`{check.formula}`",
        "metric": escaped(f"{check.metric} ({check.unit})" if check.unit else check.metric),
        "level": check.level.value,
        "reads": ", ".join(check.channels),
        "also runs": escaped("; ".join(check.siblings.values())),
        "source": escaped(check.citation),
    }
    lines = [f"**{title}** {text}\n" for title, text in facts.items() if text]
    drawn = {word: f"pictures/check-{check.id}-{word}.svg" for word in ("passes", "fails")}
    lines += [
        f"![A renderer that {word} {check.id}.](../{picture})\n"
        for word, picture in drawn.items()
        if (PAGES / "checks.py" / picture).exists()
    ]
    before, heading, after = markdown.partition("## Bound")
    return before + "\n".join(lines) + "\n" + heading + after


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
