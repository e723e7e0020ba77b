"""The README and the pages of `docs/` put to the test: renderer, suite, commands, tables and links."""

from __future__ import annotations

import re
import runpy
import shlex
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest
from ruamel.yaml import YAML

from hapticeval.cli import EXIT_CODES, main
from hapticeval.discovery import resolve
from hapticeval.phenomena.pages import read_page
from hapticeval.phenomena.registry import CHECKS
from hapticeval.runner.results import ResultsDocument, read_results

ROOT = Path(__file__).parents[1]
PAGES = {page.stem: page.read_text(encoding="utf-8") for page in [ROOT / "README.md", *(ROOT / "docs").glob("*.md")]}
README = PAGES["README"]
PHENOMENA = {"Continuous Contact Point", "Contact Normal Force", "Broken Contact", "Abrupt Switch",
             "Impulsive Collision Force", "Centripetal Force"}  # fmt: skip
"""Thesis 3.2."""


def section(title: str, page: str = "README") -> str:
    """Return the text under a heading of the second level."""
    return PAGES[page].split(f"\n## {title}\n", 1)[1].split("\n## ", 1)[0]


def test_what_an_engineer_says_is_what_the_check_s_page_says_others_call_it() -> None:
    rows = re.findall(r"^\| ([^|]+) \| `([a-z-]+)` \| [^|]+ \|$", section("What is judged"), re.MULTILINE)
    assert len(rows) > 5
    assert [
        (words, check) for words, check in rows if not {*words.split(", ")} <= {*read_page(CHECKS[check]).also_called}
    ] == []


def block(text: str, language: str, number: int = 0) -> str:
    """A fenced block of code."""
    return re.findall(rf"```{language}\n(.*?)```", text, re.DOTALL)[number]


RENDERER = block(section("Judge your own renderer"), "python")


def command(text: str) -> list[str]:
    """The arguments of the one command in a shell block."""
    program, *arguments = shlex.split(text)
    assert program == "hapticeval"
    return arguments


@pytest.fixture(scope="module")
def judged(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Path, int]]:
    """A current directory in which the README's renderer was judged by its command; the exit code."""
    folder = tmp_path_factory.mktemp("readme")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        patch.setattr(sys, "path", list(sys.path))
        (folder / "mine.py").write_text(RENDERER)
        yield folder, main(command(block(section("Judge your own renderer"), "sh")))
    sys.modules.pop("mine", None)


def test_a_renderer_takes_ten_lines() -> None:
    assert len(RENDERER.splitlines()) <= 10


def test_the_renderer_is_judged_by_the_command(judged: tuple[Path, int]) -> None:
    folder, code = judged
    results = read_results(folder / "results")
    outcomes = {(verdict.case, verdict.check): verdict.outcome for verdict in results.verdicts}
    assert results.complete
    assert outcomes["star-convex-corner", "continuous-contact"] == "fail", "as the README says"
    assert code == 1


SPACE = """
title = "In space"
[[case]]
name = "across-the-sphere"
title = "Under the surface of a sphere"
model = { kind = "sphere", size = 0.1 }
checks = ["continuous-contact", "contact-normal-force"]
trajectory = { kind = "points", points = [[0.0, 0.0, 0.06], [0.0, 0.0, 0.049], [0.001, 0.002, 0.049]], duration = 2 }
"""


def test_the_renderer_works_in_space_too(judged: tuple[Path, int]) -> None:
    (judged[0] / "space.toml").write_text(SPACE)
    assert main(["run", "space.toml", "-r", "mine:Nearest", "-o", "space"]) == 0
    assert [verdict.outcome for verdict in read_results(judged[0] / "space").verdicts] == ["pass", "pass"]


def test_every_entry_of_the_results_is_told(judged: tuple[Path, int]) -> None:
    names = set(ResultsDocument.__struct_fields__) - {"format_version"}
    assert names <= set(re.findall(r"`(\w+)`", PAGES["results"]))


def test_every_file_that_is_told_is_written(judged: tuple[Path, int]) -> None:
    told = re.findall(r"^    (results/\S+)", PAGES["results"], re.MULTILINE)
    assert len(told) >= 5
    assert [name for name in told if not (judged[0] / name).exists()] == []


def test_the_names_that_it_gives_are_renderers() -> None:
    names = re.findall(r"`([a-z-]+[+@][a-z+@-]+)`", section("Names of renderers", "write-a-renderer"))
    assert len(names) >= 2
    assert all(callable(resolve(name)) for name in names)


def test_the_example_tells_both_renderers_apart(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    example = runpy.run_path(str(ROOT / "examples" / "judge_a_renderer.py"))
    example["main"].__globals__["CASES"] = ["star-convex-corner/*-contact"]
    frame = example["main"](str(tmp_path / "judged.png")).frame()
    failed = frame[frame.outcome == "fail"]
    assert list(zip(failed.renderer, failed.check, strict=True)) == [
        ("Nearest", "continuous-contact"),
        ("Nearest", "broken-contact"),
    ]
    assert "the IHIP jumps 17.3 mm" in capsys.readouterr().out
    assert (tmp_path / "judged.png").exists()


def test_the_checks_of_the_phenomena_are_in_the_table_and_those_of_effects_on_their_page() -> None:
    table, effects = section("What is judged"), PAGES["effects"]
    phenomena = {name for name, check in CHECKS.items() if check.phenomenon in PHENOMENA}
    assert {CHECKS[name].phenomenon for name in phenomena} == PHENOMENA
    assert [name for name in phenomena if f"`{name}`" not in table] == []
    assert [name for name, check in CHECKS.items() if check.effects and f"`{name}`" not in effects] == []


def test_the_exit_codes_are_those_of_the_help() -> None:
    told = re.findall(r"^\| (\d) \|", section("Gate a merge on it"), re.MULTILINE)
    assert told == re.findall(r"^  (\d)  ", EXIT_CODES, re.MULTILINE)


def test_the_readme_is_short() -> None:
    assert len(README.split()) <= 1000


@pytest.mark.parametrize("page", PAGES)
def test_the_files_that_it_links_exist(page: str) -> None:
    folder = ROOT if page == "README" else ROOT / "docs"
    links = re.findall(r"\]\(([^)#]+)[^)]*\)", PAGES[page])
    links += ["../" * (page != "README") + name for name in named(page)]
    assert [link for link in links if not link.startswith("https://") and not (folder / link).exists()] == []


def named(page: str) -> list[str]:
    """Return the files of the repository that a page names."""
    return re.findall(r"`((?:suites|examples|hapticeval)/[\w./]+\.\w+)`", PAGES[page])


def test_the_citation_names_this_version() -> None:
    version = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]
    citation = YAML(typ="safe").load((ROOT / "CITATION.cff").read_text())
    assert citation["version"] == version
    assert f"version = {{{version}}}" in PAGES["bibliography"]
    # A commit that is tagged as a version is that version.
    tags = subprocess.run(["git", "tag", "--points-at", "HEAD"], cwd=ROOT, capture_output=True, text=True, check=False)
    assert [tag for tag in tags.stdout.split() if re.fullmatch(r"v\d.*", tag) and tag != f"v{version}"] == []
