"""The page on gates and the GitHub action put to the test: commands, list, tests, and the steps in a shell."""

import os
import re
import stat
import subprocess
import sys
from pathlib import Path

import pytest
from ruamel.yaml import YAML

from hapticeval.cli import main
from hapticeval.runner.known import KnownVerdict, read_known
from hapticeval.runner.results import read_results

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "docs" / "gate.md").read_text(encoding="utf-8")
ACTION = YAML(typ="safe").load((ROOT / "action.yml").read_text(encoding="utf-8"))
RENDERER = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(encoding="utf-8"), re.DOTALL)[0]


def blocks(language):
    """The fenced blocks of a language."""
    return re.findall(rf"```{language}[^\n]*\n(.*?)```", PAGE, re.DOTALL)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("gate")
    (made / "mine.py").write_text(RENDERER)
    (made / "known.toml").write_text(blocks("toml")[0])
    return made


@pytest.fixture
def here(folder, monkeypatch):
    monkeypatch.chdir(folder)
    monkeypatch.setattr(sys, "path", list(sys.path))
    yield folder
    sys.modules.pop("mine", None)


def test_the_list_of_the_page_is_one_that_is_written(here):
    (here / "known.toml").write_text(blocks("toml")[0])
    listed = {entry.verdicts[0] for entry in read_known(here / "known.toml").entries.values()}
    assert main(["run", "-r", "mine:Nearest", "-k", "star-convex-corner", "--no-report", "--known", "known.toml"]) == 0
    verdicts = read_results(here / "results").verdicts
    known = {KnownVerdict.of(verdict) for verdict in verdicts if verdict.standing == "known"}
    assert listed == known


def filled(text, inputs):
    """The text with the values of the expressions that the action uses."""
    values = {f"inputs.{name}": value for name, value in inputs.items()} | {"github.action_path": str(ROOT)}
    return re.sub(r"\$\{\{ (.*?) \}\}", lambda found: values[found[1]], str(text))


def wanted(condition, failed, inputs):
    """Whether GitHub runs a step with that `if`."""
    if condition is None:
        return not failed
    given = condition.removeprefix("${{ ").removesuffix(" }}").split(" && ")
    known = {"!cancelled()": True, "inputs.baseline != ''": inputs["baseline"] != ""}
    return all(known[each] for each in given)


def job(folder, **given):
    """Run the steps of the action as GitHub does in a shell, with a pip that only notes what it is asked for."""
    assert given.keys() <= ACTION["inputs"].keys()
    inputs = {name: each.get("default", "") for name, each in ACTION["inputs"].items()} | given
    bin_ = folder / "bin"
    bin_.mkdir(exist_ok=True)
    (bin_ / "python").write_text('#!/bin/bash\nprintf "%s\\n" "$@" > pip\n')
    (bin_ / "hapticeval").write_text(f'#!/bin/bash\nexec "{sys.executable}" -m hapticeval "$@"\n')
    for file in bin_.iterdir():
        file.chmod(file.stat().st_mode | stat.S_IXUSR)
    summary = folder / "summary.md"
    summary.write_text("")
    failed, out = [], ""
    for step in ACTION["runs"]["steps"]:
        if not wanted(step.get("if"), failed, inputs):
            continue
        assert step["shell"] == "bash"
        script = folder / "step.sh"
        script.write_text(filled(step["run"], inputs))
        done = subprocess.run(
            ["bash", "--noprofile", "--norc", "-eo", "pipefail", script],
            cwd=folder,
            env={
                **os.environ,
                "PATH": f"{bin_}:{os.environ['PATH']}",
                "GITHUB_STEP_SUMMARY": str(summary),
                **{name: filled(value, inputs) for name, value in step.get("env", {}).items()},
            },
            capture_output=True,
            text=True,
        )
        out += done.stdout + done.stderr
        if done.returncode:
            failed.append((step["name"], done.returncode))
    return failed, out, summary.read_text()


SELECT = "plane-press/contact-kept or star-convex-corner/broken-contact"
BROKEN = """[[known]]
renderer = "mine:Nearest"
reason = "it jumps"
verdicts = ["thesis/star-convex-corner/broken-contact"]
"""


@pytest.mark.system
def test_the_action_fails_where_the_gate_does_and_shows_the_table(folder):
    failed, out, summary = job(folder, renderers="mine:Nearest\nconstraint", select=SELECT, install="./mine pkg")
    assert failed == [("Judge", 1)], out
    assert (folder / "pip").read_text().splitlines() == ["-m", "pip", "install", str(ROOT), "./mine pkg"]
    assert "# hapticeval" in summary
    assert "star-convex-corner" in summary
    assert (folder / "results" / "badge.svg").exists()


@pytest.mark.system
def test_the_action_passes_what_is_known_and_compares(folder):
    (folder / "listed.toml").write_text(BROKEN)
    given = {"renderers": "mine:Nearest", "select": SELECT, "known": "listed.toml", "strict": "true"}
    failed, out, _ = job(folder, **given, output="base")
    assert failed == [], out
    failed, out, summary = job(folder, **given, baseline="base")
    assert failed == [], out
    assert "::notice title=hapticeval::2 verdicts in both runs: none changed" in out
    assert summary.startswith("**hapticeval**: 2 verdicts in both runs: none changed")


def test_the_action_of_wrong_input_has_no_summary(folder):
    failed, out, summary = job(folder, renderers="mine:Absent $(touch escaped) *", output="none")
    assert failed == [("Judge", 2)], out
    assert summary == ""
    assert not (folder / "escaped").exists()


def test_every_script_gets_what_users_give_by_the_environment_alone():
    for step in ACTION["runs"]["steps"]:
        assert "${{" not in step["run"], "an expression in a script lets an input run code"
    assert all(each["description"] for each in ACTION["inputs"].values())


def test_the_workflow_of_the_page_gives_the_action_what_it_takes():
    steps = YAML(typ="safe").load(blocks("yaml")[0])["jobs"]["conformance"]["steps"]
    (ours,) = [step for step in steps if step.get("uses", "").startswith("./")]
    required = {name for name, each in ACTION["inputs"].items() if each.get("required")}
    assert required <= ours["with"].keys() <= ACTION["inputs"].keys()
