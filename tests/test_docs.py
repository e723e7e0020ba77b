"""The pages of documentation: their commands are commands, their pages are all in the contents, their notebooks run."""

from __future__ import annotations

import re
import shlex
from pathlib import Path
from typing import Any

import pytest
import typer

from hapticeval.cli import app

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
GENERATED = {"index.md", "api.md", "checks.md", "architecture.md", "contributing.md", "changelog.md"}
COMMAND = re.compile(r"^(?:    )?(hapticeval .+)$", re.MULTILINE)


def commands(page: Path) -> list[str]:
    """Return the lines of a page that begin with the command."""
    return COMMAND.findall(page.read_text(encoding="utf-8").replace("\\\n", " "))


LINES = sorted({line for page in PAGES for line in commands(page)})


def test_there_are_commands_to_check() -> None:
    assert len(LINES) > 40


@pytest.mark.parametrize("line", LINES)
def test_every_command_has_the_options_that_are_written(line: str) -> None:
    program: Any = typer.main.get_command(app)
    words = shlex.split(re.split(r"[|;&>]|\s{3,}", line)[0], comments=True)[1:]
    if words[0].startswith("-"):
        return
    command = program.commands[words[0]]
    command.make_context(words[0], words[1:])


def test_every_page_is_in_the_contents() -> None:
    listed = set(re.findall(r": ([\w-]+\.md)$", (ROOT / "mkdocs.yml").read_text(encoding="utf-8"), re.MULTILINE))
    assert listed == {page.name for page in PAGES[1:]} | GENERATED


@pytest.mark.docs
@pytest.mark.parametrize("path", sorted((ROOT / "examples" / "notebooks").glob("*.ipynb")), ids=lambda path: path.stem)
def test_the_notebook_runs(path: Path, tmp_path: Path) -> None:
    nbclient = pytest.importorskip("nbclient", reason="make docs installs it")
    nbformat = pytest.importorskip("nbformat")
    notebook = nbformat.read(path, as_version=4)
    nbclient.NotebookClient(notebook, timeout=300, resources={"metadata": {"path": str(tmp_path)}}).execute()
    assert all(cell.outputs for cell in notebook.cells[-2:] if cell.cell_type == "code")
