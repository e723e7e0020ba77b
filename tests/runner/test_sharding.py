"""Shards do all of a plan, each job once; merged they are the run that would have done all of it."""

from __future__ import annotations

import shutil
import sys

import many_jobs
import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st
from result_entries import results_of, run_entry

from hapticeval import api
from hapticeval.cli import main
from hapticeval.errors import HapticevalError, InputError, NothingSelectedError
from hapticeval.runner.merging import merge_results
from hapticeval.runner.planning import Job, Shard
from hapticeval.runner.results import Command, Environment, SuiteEntry, read_results
from hapticeval.suite.case import Case

RENDERERS = ["noisy:Noisy", "noisy:Other"]


def jobs(names):
    return [
        Job("s", Case(name=case, title="", model={"kind": "line"}, checks=("memoryless",)), renderer)
        for case in names
        for renderer in ("a", "b", "c")
    ]


@given(st.integers(1, 12), st.integers(1, 20))
def test_shards_do_every_job_once_and_differ_by_one(cases, count):
    every = jobs([f"case-{number}" for number in range(cases)])
    count = min(count, len(every))
    shards = [Shard(number, count).of(every) for number in range(1, count + 1)]
    assert sorted((job.case.name, job.renderer) for shard in shards for job in shard) == sorted(
        (job.case.name, job.renderer) for job in every
    )
    sizes = {len(shard) for shard in shards}
    assert max(sizes) - min(sizes) <= 1
    for shard in shards:
        places = [every.index(job) for job in shard]
        assert places == sorted(places), "in the order of the plan"
    backwards = [set(map(id, Shard(number, count).of(every[::-1]))) for number in range(1, count + 1)]
    assert backwards == [set(map(id, shard)) for shard in shards], "whatever that order is"


@pytest.mark.parametrize("text", ["", "3", "0/3", "4/3", "1/0", "-1/3", "1/3/5", "a/b", "1.0/2", " 1/2"])
def test_what_is_no_shard_is_refused(refused, text):
    with refused(InputError):
        Shard.parse(text)


def test_an_empty_shard_says_how_many_there_can_be(refused):
    with refused(NothingSelectedError):
        Shard(4, 5).of(jobs(["one"]))


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """One run of all, of its three shards, and of each renderer: folders by name."""
    here = tmp_path_factory.mktemp("shards")
    suite = many_jobs.write(here, 4)
    sys.path.insert(0, str(here))
    found = {"all": api.run(RENDERERS, suites=suite, output=here / "all", workers=0)}
    for number in range(1, 4):
        options = {"shard": f"{number}/3", "output": here / f"shard-{number}"}
        found[f"shard-{number}"] = api.run(RENDERERS, suites=suite, workers=0, **options)
    for name in RENDERERS:
        found[name] = api.run([name], suites=suite, output=here / name[6:], workers=0)
    sys.path.remove(str(here))
    sys.modules.pop("noisy", None)
    return {name: results.folder for name, results in found.items()}


SHARDS = ["shard-2", "shard-3", "shard-1"]


@pytest.mark.parametrize("names", [SHARDS, RENDERERS, ["all"]])
def test_merged_they_are_one_run(folders, tmp_path, names):
    before = {name: many_jobs.found(folders[name]) for name in names}
    results = api.merge([folders[name] for name in names], tmp_path / "out")
    assert many_jobs.found(tmp_path / "out") == many_jobs.found(folders["all"])
    assert {name: many_jobs.found(folders[name]) for name in names} == before
    whole = read_results(folders["all"])
    assert results.document.command == whole.command
    assert results.document.timing.simulated_seconds == pytest.approx(whole.timing.simulated_seconds)
    assert results.exit_code == api.Results.read(folders["all"]).exit_code
    assert results.recording("slide-1", "noisy:Other").hip.shape[1] == 2


@pytest.mark.usefixtures("in_process")
def test_the_command_writes_reports_of_it(folders, tmp_path, capsys):
    code = main(["merge", *(str(folders[name]) for name in SHARDS), "-o", str(tmp_path / "out")])
    assert code == api.Results.read(folders["all"]).exit_code
    assert "16 of 16 planned verdicts ran" in capsys.readouterr().out
    assert (tmp_path / "out" / "report" / "index.html").exists()


@pytest.mark.parametrize(
    "names",
    [
        ["shard-1", "shard-3"],
        ["shard-2"],
        ["all", "shard-1"],
        ["all", "noisy:Noisy"],
        ["all", "all"],
        [],
    ],
)
def test_what_is_not_one_run_is_refused(refused, folders, tmp_path, names):
    with refused(InputError):
        api.merge([folders[name] for name in names], tmp_path / "out")
    assert not (tmp_path / "out" / "results.json").exists()


def test_a_folder_cannot_be_merged_into_itself(refused, folders, tmp_path):
    shutil.copytree(folders["all"], tmp_path / "all")
    with refused(InputError):
        api.merge([tmp_path / "all"], tmp_path / "all")
    assert many_jobs.found(tmp_path / "all") == many_jobs.found(folders["all"])


def test_recordings_have_to_be_there(refused, folders, tmp_path):
    shutil.copytree(folders["all"], tmp_path / "all")
    next((tmp_path / "all" / "recordings").rglob("*.h5")).unlink()
    with refused(HapticevalError):
        api.merge([tmp_path / "all"], tmp_path / "out")


SUITE = SuiteEntry(name="s", title="S", citation="", rows=[], digest="1")


STRICT = Command(suites=["s"], renderers=["r"], select=[], strict=True)


def environment(**versions):
    return Environment(python="3.11", platform="Linux", cpu_count=2, versions={"hapticeval": "0.1.0", **versions})


@pytest.mark.parametrize(
    "changes",
    [
        {"seed": 4},
        {"environment": environment(numpy="2.1.0")},
        {"command": Command(suites=["s"], renderers=["r"], select=[], strict=True)},
        {"suites": [msgspec.structs.replace(SUITE, digest="2")]},
    ],
)
def test_runs_that_were_not_made_alike_are_refused(refused, changes):
    one = results_of(runs=[run_entry(case="one")], suites=[SUITE], environment=environment())
    other = results_of(runs=[run_entry(case="two")], **{"suites": [SUITE], "environment": environment(), **changes})
    with refused(InputError):
        merge_results({"a": one, "b": other})


def test_what_is_incomplete_stays_incomplete():
    part = {"planned": 3, "complete": False, "reason": "interrupted by the user"}
    one = results_of(runs=[run_entry(case="one")], **part)
    other = results_of(runs=[run_entry(case="two")])
    document = merge_results({"a": one, "b": other})
    assert (document.complete, document.reason, document.planned) == (False, "a: interrupted by the user", 3)
