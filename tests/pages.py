"""What the pages of documentation hold: blocks of code, which files they are, and how they are run.

All fenced blocks of a page are run, from its top to its end, in one folder that has the README's `mine.py`. A block
with `title="NAME"` is a file that the reader saves. `title="not run: REASON"`, which the reader sees, leaves one out.

- `sh`: line by line, as typed. A line ends with exit code 0, or with that of its comment: `# exit code 1`.
- `python`: one program through all of the page. A comment behind `print(...)` is what is printed.
- `toml`: a suite, or a part of a case, is read as such; lines that all set the same entry are read one by one.
"""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from contextlib import redirect_stdout
from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML

from hapticeval.suite.reading import load_suite

ROOT = Path(__file__).parents[1]
PAGES = {page.stem: page for page in [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]}
FENCE = re.compile(r"^```(\w+)(?: title=\"([^\"]+)\")?\n(.*?)^```$", re.MULTILINE | re.DOTALL)
NOT_RUN = "not run: "
PATIENCE = 300.0
"""Seconds that a typed line may take."""
EXIT = re.compile(r"# exit code (\d)(?: or (\d))?$")


@dataclass(frozen=True)
class Block:
    """A fenced block of a page: its `line` there (from 1), `language`, `title` ("" without one) and `text`."""

    page: str
    line: int
    language: str
    title: str
    text: str

    @property
    def place(self) -> str:
        return f"{self.page}:{self.line}"

    @property
    def runs(self) -> bool:
        return not self.title.startswith(NOT_RUN)


def blocks(page: str) -> list[Block]:
    """Return the fenced blocks of a page. Raises ValueError where a fence is none of those above."""
    text = PAGES[page].read_text(encoding="utf-8")
    found = [
        Block(page, text[: each.start()].count("\n") + 1, each[1], each[2] or "", each[3])
        for each in FENCE.finditer(text)
    ]
    if len(re.findall(r"^```", text, re.MULTILINE)) != 2 * len(found):
        raise ValueError(f"{page} has a fence that is not understood")
    return found


def lines(block: Block) -> Iterator[tuple[int, str]]:
    """Yield the commands of a shell block, each with its line on the page; one that goes on with a backslash is one."""
    start, kept = 0, ""
    for number, line in enumerate(block.text.splitlines(), block.line + 1):
        start = start or number
        kept += line
        if kept.endswith("\\"):
            kept += "\n"
            continue
        if kept.strip() and not kept.lstrip().startswith("#"):
            yield start, kept
        start, kept = 0, ""


class Reader:
    """Somebody who goes through a page in a folder: types its commands, saves its files, runs its Python."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.names: dict[str, Any] = {"__name__": "__main__"}
        self.environment = {
            # A page's own pytest is no worker of the one that runs it.
            **{name: value for name, value in os.environ.items() if not name.startswith("PYTEST_")},
            "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}",
            "MPLBACKEND": "Agg",
        }

    def read(self, page: str) -> None:
        """Go through a page. Raises AssertionError, with the line, where something is not as written."""
        for block in blocks(page):
            if not block.runs:
                continue
            if block.title:
                self._save(block)
            else:
                getattr(self, f"_{block.language}")(block)

    def _save(self, block: Block) -> None:
        (self.folder / block.title).parent.mkdir(parents=True, exist_ok=True)
        (self.folder / block.title).write_text(block.text, encoding="utf-8")
        if block.title == "pyproject.toml":  # as `pip install .` would: the names of the package are known from here on
            information = self.folder / "mine-1.0.dist-info"
            information.mkdir(exist_ok=True)
            points = tomllib.loads(block.text)["project"]["entry-points"]
            text = "".join(
                f"[{group}]\n" + "".join(f"{k} = {v}\n" for k, v in each.items()) for group, each in points.items()
            )
            (information / "METADATA").write_text("Metadata-Version: 2.1\nName: mine\nVersion: 1.0\n")
            (information / "entry_points.txt").write_text(text)
            self.environment["PYTHONPATH"] = str(self.folder)

    def _sh(self, block: Block) -> None:
        for number, line in lines(block):
            wanted = [int(each) for each in found.groups() if each] if (found := EXIT.search(line)) else [0]
            code, printed = self._type(line)
            assert code in wanted, f"{block.page}:{number}: {line}\nexit code {code}\n{printed[-6000:]}"

    def _type(self, line: str) -> tuple[int | None, str]:
        """Return exit code and output of a line, None as the code of one that hangs; nothing of it is left running."""
        with subprocess.Popen(
            ["bash", "-o", "pipefail", "-c", line], cwd=self.folder, env=self.environment, start_new_session=True,
            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
        ) as process:  # fmt: skip
            try:
                printed, _ = process.communicate(timeout=PATIENCE)
            except subprocess.TimeoutExpired:
                os.killpg(process.pid, signal.SIGKILL)
                return None, process.communicate()[0]
            return process.returncode, printed

    def _python(self, block: Block) -> None:
        printed = StringIO()
        with redirect_stdout(printed):
            exec(compile("\n" * block.line + block.text, str(PAGES[block.page]), "exec"), self.names)
        for told in re.findall(r"^print\(.*\) +# (.+)$", block.text, re.MULTILINE):
            assert told in printed.getvalue(), f"{block.place}: {told}\n{printed.getvalue()}"

    def _toml(self, block: Block) -> None:
        rows = block.text.splitlines()
        alternatives = len({row.partition(" = ")[0] for row in rows}) == 1
        for text in rows if alternatives else [block.text]:
            (self.folder / "part.toml").write_text(whole(text), encoding="utf-8")
            for case in load_suite(str(self.folder / "part.toml")).cases:
                case.build_scene()

    def _yaml(self, block: Block) -> None:
        assert YAML(typ="safe").load(block.text)


CASE = {
    "name": '"part"',
    "title": '"A case around it"',
    "model": '{ kind = "polygon", vertices = [[0.0, 0.0], [0.1, 0.0], [0.1, 0.1], [0.0, 0.1]] }',
    "checks": '["contact-kept"]',
    "experiment": "{ duration = 1.0, position = [0.0, 0.2], force = [[0, 0.0, -1.0]] }",
}


def whole(text: str) -> str:
    """Return a part of a case as a suite: what it lacks is put around it."""
    part = tomllib.loads(text)
    if isinstance(part.get("case"), list):
        return text
    head = [f"{name} = {value}" for name, value in CASE.items() if name not in part]
    return "\n".join(['title = "A part"', "[[case]]", *head, *["[case.scene]"] * ("effects" in part), text])
