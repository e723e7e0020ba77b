"""The page on gates and the GitHub action put to the test: commands, list, tests, and the steps in a shell."""

import os
import re
import stat
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest
from ruamel.yaml import YAML

from hapticeval.cli import main
from hapticeval.commands.authors import STARTERS, WORKFLOW, write_starter
from hapticeval.runner.known import KnownVerdict, read_known
from hapticeval.runner.results import read_results

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "docs" / "gate.md").read_text(encoding="utf-8")
ACTION = YAML(typ="safe").load((ROOT / "action.yml").read_text(encoding="utf-8"))
README = (ROOT / "README.md").read_text(encoding="utf-8")
RENDERER = re.findall(r"```python\n(.*?)```", README, re.DOTALL)[0]


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
    """The text with the values of the expressions that the action's scripts use."""
    values = {f"inputs.{name}": value for name, value in inputs.items()} | {"github.action_path": str(ROOT)}
    return re.sub(r"\$\{\{ (.*?) \}\}", lambda expression: values[expression[1]], str(text))


def wanted(condition, failed, inputs):
    """Whether GitHub runs a step with that `if`."""
    if condition is None:
        return not failed
    terms = condition.removeprefix("${{ ").removesuffix(" }}").split(" && ")
    known = {"!cancelled()": True, "inputs.baseline != ''": inputs["baseline"] != ""}
    return all(known[term] for term in terms)


def job(folder, **given):
    """Run the steps of the action as GitHub does in a shell, with a pip that only notes what it is asked for."""
    assert given.keys() <= ACTION["inputs"].keys()
    inputs = {name: entry.get("default", "") for name, entry in ACTION["inputs"].items()} | given
    bin_ = folder / "bin"
    bin_.mkdir(exist_ok=True)
    (bin_ / "python").write_text('#!/bin/bash\n[ "$3" != install ] || printf "%s\\n" "$@" > pip\n')
    (bin_ / "hapticeval").write_text(f'#!/bin/bash\nexec "{sys.executable}" -m hapticeval "$@"\n')
    for file in bin_.iterdir():
        file.chmod(file.stat().st_mode | stat.S_IXUSR)
    summary = folder / "summary.md"
    summary.write_text("")
    failed, out = [], ""
    for step in ACTION["runs"]["steps"]:
        if "uses" in step or not wanted(step.get("if"), failed, inputs):
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
                "GITHUB_OUTPUT": str(folder / "outputs"),
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
    failed, out, summary = job(
        folder, renderers="mine:Nearest\nconstraint", select=SELECT, install="./mine pkg\nnumpy\n"
    )
    assert failed == [("Judge", 1)], out
    assert (folder / "pip").read_text().splitlines() == ["-m", "pip", "install", str(ROOT), "./mine pkg", "numpy"]
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


@pytest.mark.system
def test_a_renderer_that_is_a_command_with_arguments_is_one(folder):
    (folder / "lines.py").write_text((ROOT / "examples" / "process" / "mine.py").read_text())
    failed, out, summary = job(
        folder, renderers="cmd:python3 lines.py\n", select="plane-press/contact-kept", output="cmd"
    )
    assert failed == [], out
    assert "cmd:python3 lines.py" in summary


def test_every_script_gets_what_users_give_by_the_environment_alone():
    for step in ACTION["runs"]["steps"]:
        assert "${{" not in step.get("run", ""), "an expression in a script lets an input run code"
    assert all(entry["description"] for entry in ACTION["inputs"].values())


def workflows():
    """Each workflow that a page shows in full or `hapticeval new` writes, by its place."""
    for name in ("README.md", "docs/gate.md"):
        for number, block in enumerate(re.findall(r"```yaml\n(.*?)```", (ROOT / name).read_text(), re.DOTALL)):
            if re.search("^jobs:", block, re.MULTILINE):
                yield f"{name}-{number}", block
    for file in sorted((ROOT / ".github" / "workflows").glob("*.yml")):
        yield file.name, file.read_text()
    for kind in STARTERS:
        with tempfile.TemporaryDirectory() as folder:
            write_starter(kind, Path(folder) / "mine")
            yield f"new-{kind}", (Path(folder) / "mine" / WORKFLOW).read_text()


WORKFLOWS = dict(workflows())


@pytest.mark.docs
@pytest.mark.parametrize("text", WORKFLOWS.values(), ids=WORKFLOWS)
def test_the_workflows_are_valid(text, tmp_path):
    (tmp_path / "workflow.yml").write_text(text)
    validate("vendor.github-workflows", tmp_path / "workflow.yml")


@pytest.mark.docs
@pytest.mark.parametrize("place", ["README.md-0", "new-python", "new-process"])
def test_the_steps_of_a_workflow_run_in_a_scratch_repository(place, tmp_path):
    """Each step's script, in order, as GitHub runs it; pip is one that only notes what it is asked for."""
    kind = place.removeprefix("new-")
    repository = tmp_path / "mine"
    if kind in STARTERS:
        write_starter(kind, repository)
    else:
        repository.mkdir()
        (repository / "mine.py").write_text(RENDERER)
    commands = tmp_path / "bin"
    commands.mkdir()
    for name, script in {
        "pip": f'printf "%s\\n" "$@" >> "{tmp_path}/pip"',
        "pytest": f'exec "{sys.executable}" -m pytest "$@"',
        "hapticeval": f'exec "{sys.executable}" -m hapticeval "$@"',
    }.items():
        (commands / name).write_text(f"#!/bin/bash\n{script}\n")
        (commands / name).chmod(0o755)
    if kind not in STARTERS:
        (list_failures,) = re.findall(r"`(hapticeval run .*--write-known known.toml)`", README)
        subprocess.run([commands / "hapticeval", *list_failures.split()[1:]], cwd=repository, check=True)
    workflow = YAML(typ="safe").load(WORKFLOWS[place])
    (steps,) = (job["steps"] for job in workflow["jobs"].values())
    environment = {
        **os.environ,
        **workflow.get("env", {}),
        "PATH": f"{commands}:{os.environ['PATH']}",
        "GITHUB_STEP_SUMMARY": str(tmp_path / "summary.md"),
    }
    codes = {}
    for step in steps:
        if "run" in step:
            command = ["bash", "--noprofile", "--norc", "-eo", "pipefail", "-c", step["run"]]
            done = subprocess.run(command, cwd=repository, env=environment, capture_output=True, text=True)
            codes[step["run"]] = done.returncode
    failed = [script for script, code in codes.items() if code]
    # What the README's renderer fails is on its list; what `new` writes passes.
    assert failed == [], codes
    assert "hapticeval @ git+https://" in (tmp_path / "pip").read_text()
    summary = (tmp_path / "summary.md").read_text()
    assert "# hapticeval: Every verdict is as expected" in summary
    assert ("## Known\n" in summary) is (kind not in STARTERS)


@pytest.mark.docs
def test_the_action_is_valid():
    validate("vendor.github-actions", ROOT / "action.yml")


def validate(schema, file):
    command = [sys.executable, "-m", "check_jsonschema", "--builtin-schema", schema, file]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout


def test_the_workflow_of_the_page_gives_the_action_what_it_takes():
    steps = YAML(typ="safe").load(blocks("yaml")[0])["jobs"]["conformance"]["steps"]
    (ours,) = [step for step in steps if "/hapticeval@" in step.get("uses", "")]
    required = {name for name, entry in ACTION["inputs"].items() if entry.get("required")}
    assert required <= ours["with"].keys() <= ACTION["inputs"].keys()
