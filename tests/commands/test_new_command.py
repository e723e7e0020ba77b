"""Renderers to start from: written, built, tested by their own tests, and judged as their CI file does."""

from __future__ import annotations

import re
import runpy
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from hapticeval.cli import main
from hapticeval.commands.authors import STARTERS, WORKFLOW


@pytest.fixture(params=STARTERS)
def kind(request: pytest.FixtureRequest) -> str:
    if request.param in ("c", "cpp") and not (shutil.which("make") and shutil.which("cc") and shutil.which("c++")):
        pytest.skip("no compiler, or no make")
    return str(request.param)


@pytest.fixture
def folder(kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    assert main(["new", kind, "my-laser"]) == 0
    monkeypatch.setattr(sys, "path", [str(tmp_path / "my-laser"), *sys.path])
    monkeypatch.chdir(tmp_path / "my-laser")
    yield tmp_path / "my-laser"
    sys.modules.pop("my_laser", None)


@pytest.mark.system
def test_it_passes_its_own_test_and_its_ci(kind: str, folder: Path) -> None:
    (test,) = folder.glob("test_*.py")
    names = runpy.run_path(str(test))
    (check,) = (value for name, value in names.items() if name.startswith("test_"))
    check()
    steps = re.findall(r"- run: (.*)", (folder / WORKFLOW).read_text())
    (judged,) = (shlex.split(each) for each in steps if each.startswith("hapticeval run"))
    assert ("make" in steps) == (kind in ("c", "cpp"))
    assert main(judged[1:]) == 0
    written = [each for each in folder.rglob("*") if each.suffix in (".c", ".cpp", ".m", ".py", ".so")]
    assert {each.stem.removeprefix("lib").removeprefix("test_") for each in written} == {"my_laser"}
    assert not any(each.suffix != ".so" and re.search(r"\bmine\b", each.read_text()) for each in written)


def test_what_comes_next_is_printed(kind: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["new", kind, str(tmp_path / "made")]) == 0
    printed = capsys.readouterr().out
    assert "hapticeval doctor -r" in printed
    assert "hapticeval search -r" in printed


def test_a_folder_with_something_in_it_is_left_alone(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "mine.py").write_text("precious")
    assert main(["new", "python", str(tmp_path)]) == 2
    assert "not an empty folder" in capsys.readouterr().err
    assert [each.name for each in tmp_path.iterdir()] == ["mine.py"]


def test_another_kind_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["new", "pyton", str(tmp_path / "a")]) == 2
    assert "did you mean python?" in capsys.readouterr().err


@pytest.mark.system
def test_the_cmake_project_builds(tmp_path: Path) -> None:
    if not (shutil.which("cmake") and shutil.which("c++")):
        pytest.skip("no CMake, or no compiler")
    assert main(["new", "cpp", str(tmp_path / "mine")]) == 0
    for command in (["cmake", "-B", "build", "."], ["cmake", "--build", "build"]):
        subprocess.run(command, cwd=tmp_path / "mine", check=True, capture_output=True)
    assert (tmp_path / "mine" / "libmine.so").is_file()


@pytest.mark.parametrize(
    ("folder", "module"),
    [("json", "json_renderer"), ("numpy", "numpy_renderer"), ("3d", "renderer_3d"), ("A b", "A_b")],
)
def test_a_name_that_is_taken_or_none_is_changed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], folder: str, module: str
) -> None:
    assert main(["new", "python", str(tmp_path / folder)]) == 0
    assert (tmp_path / folder / f"{module}.py").is_file()
    assert f"hapticeval doctor -r {module}:Nearest" in capsys.readouterr().out
