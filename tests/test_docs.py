"""The pages of documentation: all that stands in them runs, their pages are all in the contents, their notebooks run.

The pages are run in `build/pages`, a folder each, from where the site takes the pictures that their commands draw.
"""

from __future__ import annotations

import re
import runpy
import shlex
import shutil
import sys
from itertools import takewhile
from pathlib import Path
from typing import Any

import click
import pytest
import typer
from pages import NOT_RUN, PAGES, ROOT, Reader, blocks, lines

from hapticeval.cli import app

GENERATED = {
    *("index.md", "api.md", "notebooks.md", "reports.md"),
    *("architecture.md", "contributing.md", "changelog.md"),
}
BLOCKS = [block for page in PAGES for block in blocks(page)]
COMMANDS = [line for block in BLOCKS if block.language == "sh" for _, line in lines(block)]
TOUR = re.findall(r"^    (hapticeval .+)$", PAGES["README"].read_text(encoding="utf-8"), re.MULTILINE)
PROGRAM: Any = typer.main.get_command(app)
DRAWN = ROOT / "build" / "pages"


def test_there_are_commands_to_check() -> None:
    assert len(COMMANDS) > 40


def test_every_command_has_the_options_that_are_written() -> None:
    for line in {*COMMANDS, *TOUR}:
        words = list(takewhile(lambda word: word not in ("|", ">"), shlex.split(line, comments=True)))
        if words[0] != "hapticeval" or words[1].startswith("-"):
            continue
        group, *rest = words
        program = PROGRAM
        while rest and hasattr(program, "commands"):
            group, program, rest = rest[0], program.commands[rest[0]], rest[1:]
        try:
            program.make_context(group, rest)
        except click.ClickException as wrong:
            pytest.fail(f"{line}: {wrong.format_message()}")


def found_in_pages(pattern: str) -> set[tuple[str, Any]]:
    """What stands in a page, with its name."""
    texts = {page: path.read_text(encoding="utf-8") for page, path in PAGES.items()}
    return {(page, words) for page, text in texts.items() for words in re.findall(pattern, text, re.MULTILINE)}


def test_every_command_that_is_named_exists() -> None:
    named = found_in_pages(r"`hapticeval ([a-z]\w*)(?: ([a-z]\w*))?")
    assert {place for place in named if place[1][0] not in PROGRAM.commands} == set()
    studies = {place for place in named if place[1][0] == "study"}
    assert {place for place in studies if place[1][1] not in PROGRAM.commands["study"].commands} == set()


def test_every_rule_of_make_that_is_named_exists() -> None:
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    rules = set(re.findall(r"^([a-z][a-z-]*):", makefile, re.MULTILINE))
    assert set(re.findall(r"^# make ([a-z-]+) ", makefile, re.MULTILINE)) <= rules
    assert {place for place in found_in_pages(r"`make ([a-z-]+)[^`]*`") if place[1] not in rules} == set()


def test_commands_stand_in_blocks_that_are_run() -> None:
    commands = found_in_pages(r"^    (?:hapticeval|python|pip|pytest|cc|c\+\+) .*$")
    assert {place for place in commands if place[0] != "README"} == set()


def test_what_is_not_run_says_why() -> None:
    reasons = {block.place: block.title.removeprefix(NOT_RUN).split() for block in BLOCKS if not block.runs}
    assert {place: words for place, words in reasons.items() if len(words) < 3} == {}


def test_every_page_is_in_the_contents() -> None:
    listed = set(re.findall(r": ([\w-]+\.md)$", (ROOT / "mkdocs.yml").read_text(encoding="utf-8"), re.MULTILINE))
    assert listed == {page.name for page in PAGES.values() if page.name != "README.md"} | GENERATED


def folder_of(page: str) -> Path:
    """Make a folder in which the README's renderer lies, and the examples where the page uses them."""
    made = DRAWN / page
    shutil.rmtree(made, ignore_errors=True)
    made.mkdir(parents=True)
    (renderer,) = (block for block in blocks("README") if block.language == "python")
    (made / "mine.py").write_text(renderer.text, encoding="utf-8")
    if any("examples/" in block.text for block in blocks(page)):
        (made / "examples").symlink_to(ROOT / "examples")
    return made


@pytest.mark.docs
@pytest.mark.parametrize("page", [page for page in PAGES if page != "README"])
def test_the_page_runs(page: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder_of(page))
    monkeypatch.syspath_prepend(str(Path.cwd()))
    Reader(Path.cwd()).read(page)
    sys.modules.pop("mine", None)


@pytest.mark.docs
@pytest.mark.parametrize("script", sorted((ROOT / "docs" / "pictures").glob("*.py")), ids=lambda path: path.stem)
def test_the_pictures_are_drawn(script: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = DRAWN / f"{script.stem}.py"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    monkeypatch.chdir(folder)
    runpy.run_path(str(script))
    assert list(folder.glob("pictures/*.svg"))


@pytest.mark.docs
@pytest.mark.parametrize("path", sorted((ROOT / "examples" / "notebooks").glob("*.ipynb")), ids=lambda path: path.stem)
def test_the_notebook_runs(path: Path, tmp_path: Path) -> None:
    nbclient = pytest.importorskip("nbclient", reason="make docs installs it")
    nbformat = pytest.importorskip("nbformat")
    notebook = nbformat.read(path, as_version=4)
    nbclient.NotebookClient(notebook, timeout=300, resources={"metadata": {"path": str(tmp_path)}}).execute()
    assert all(cell.outputs for cell in notebook.cells[-2:] if cell.cell_type == "code")


def test_no_page_imports_from_an_inner_module() -> None:
    """Rooms may move without breaking anyone: what others import, `hapticeval` exports."""
    assert found_in_pages(r"(?:from|import) hapticeval\.\w+") == set()
