"""Runs on a real dask scheduler with real workers: the same verdicts, whoever is killed; and who is refused."""

from __future__ import annotations

import os
import random
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import many_jobs
import pytest
from clusters import Cluster

from hapticeval import api
from hapticeval.cli import main
from hapticeval.errors import InputError
from hapticeval.phenomena.verdict import Outcome
from hapticeval.runner.events import WorkerRefused
from hapticeval.runner.results import read_results
from hapticeval.runner.resuming import OUTCOMES
from hapticeval.workers import Answer

pytest.importorskip("distributed")
pytestmark = pytest.mark.system

RENDERERS = ["noisy:Noisy", "noisy:Other"]


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A folder with a suite and a module of renderers, from which workers import."""
    here = tmp_path_factory.mktemp("cluster")
    many_jobs.write(here, 20)
    return here


@pytest.fixture(scope="module")
def cluster(place):
    with Cluster(place, 2) as found:
        yield found


@pytest.fixture
def here(place, monkeypatch):
    monkeypatch.chdir(place)
    monkeypatch.syspath_prepend(str(place))
    yield place
    sys.modules.pop("noisy", None)


def run(output, **options):
    return api.run(RENDERERS, suites="many.toml", output=output, **options)


def test_verdicts_and_recordings_are_those_of_one_process(here, cluster):
    results = run("there", scheduler=cluster.address)
    assert results.complete
    assert many_jobs.found(here / "there") == many_jobs.found(run("here", workers=0).folder)
    without = run(None, scheduler=cluster.address, select=["slide-1"])
    assert len(without.recording("slide-1", "noisy:Noisy")) == 21


def test_a_search_with_several_seeds_finds_there_what_it_finds_here(here, cluster):
    asked = ["search", "-r", "noisy:Noisy", "--check", "contact-normal-force", "--model", "circle", "--examples", "3"]
    asked += ["--seconds", "3600"]
    for name, options in {"there": ["--scheduler", cluster.address], "here": []}.items():
        assert main([*asked, "--seeds", "2", "-o", f"found-{name}", *options]) == 1
    found = [file for file in sorted(here.glob("found-here/*/*.*")) if file.suffix not in (".png", ".svg")]
    assert [file.suffix for file in found] == [".csv", ".json", ".toml"]
    for file in found:
        assert (here / "found-there" / file.relative_to(here / "found-here")).read_bytes() == file.read_bytes()


def test_a_call_whose_worker_is_killed_is_made_again(cluster):
    from hapticeval.runner import cluster as clusters

    with clusters.Cluster(time.sleep, cluster.address) as crew:
        for number in range(3):
            crew.begin(number, 1.0)
            # On a busy machine it may have ended by now.
            answers = crew.answers(0.5)
            for pid in cluster.pids():
                os.kill(pid, signal.SIGKILL)
            assert (answers or crew.answers()) == [Answer(number, None, None)]


def test_a_renderer_that_ends_its_process_ends_no_worker(here, cluster):
    pids = cluster.pids()
    options = {"suites": "many.toml", "select": ["slide-0", "slide-1"]}
    (here / "killed").unlink(missing_ok=True)
    there = api.run(["noisy:Killed", "noisy:Noisy"], output="there", scheduler=cluster.address, **options)
    assert (here / "killed").read_text() == "xxx" * 2
    local = api.run(["noisy:Killed", "noisy:Noisy"], output="here", workers=1, **options)
    assert many_jobs.found(there.folder) == many_jobs.found(local.folder)
    assert sum(verdict.outcome is Outcome.ERROR for verdict in there.verdicts) == 4
    assert cluster.pids() == pids


def test_workers_of_another_version_or_processor_are_named_and_get_no_job(here, cluster, tmp_path):
    info = tmp_path / "hapticeval-0.0.9.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: hapticeval\nVersion: 0.0.9\n")
    others = [
        cluster.start_worker("--no-nanny", "--name", "old", PYTHONPATH=str(tmp_path)),
        cluster.start_worker("--no-nanny", "--name", "generic", NUMBA_CPU_NAME="generic", NUMBA_CPU_FEATURES=""),
    ]
    try:
        while len(cluster.pids()) < 4:
            time.sleep(0.1)
        events = []
        results = run("out", scheduler=cluster.address, select=["slide-1*"], watch=events.append)
        refused = " ".join(each.why for each in events if isinstance(each, WorkerRefused))
        assert "hapticeval 0.0.9 in place of" in refused
        assert "CPU generic in place of" in refused
        assert "CPU features" in refused
        assert results.complete
    finally:
        for process in others:
            process.kill()
            process.wait()


def test_where_all_are_unlike_nothing_is_run_or_removed(here, cluster, monkeypatch, capsys):
    before = many_jobs.found(run("kept", workers=0, select=["slide-1"]).folder)
    monkeypatch.setenv("NUMBA_CPU_NAME", "another")
    code = main(["run", "many.toml", "-rnoisy:Noisy", "-o", "kept", "--scheduler", cluster.address])
    assert code == 2
    error = capsys.readouterr().err
    assert "is like this machine" in error
    assert "in place of another" in error
    assert many_jobs.found(here / "kept") == before


def test_a_file_that_a_case_names_has_to_be_the_same_there(here, cluster, monkeypatch):
    from hapticeval.runner import execution

    monkeypatch.setattr(execution, "files_of", lambda case: {str(here / "many.toml"): "0" * 64})
    with pytest.raises(InputError) as caught:
        run("out", scheduler=cluster.address)
    assert f"has the file {here / 'many.toml'} another" in caught.value.why


def test_no_scheduler_and_no_library_are_errors_of_usage(here, monkeypatch, capsys):
    monkeypatch.setattr("hapticeval.runner.cluster.CONNECT_SECONDS", 0.5)
    assert main(["run", "many.toml", "-rnoisy:Noisy", "-o", "x", "--scheduler", "tcp://127.0.0.1:9"]) == 2
    assert "no dask scheduler answers at tcp://127.0.0.1:9" in capsys.readouterr().err
    monkeypatch.delitem(sys.modules, "hapticeval.runner.cluster")
    monkeypatch.setitem(sys.modules, "distributed", None)
    assert main(["run", "many.toml", "-rnoisy:Noisy", "-o", "x", "--scheduler", "tcp://127.0.0.1:9"]) == 2
    # By the folder of a checkout, or by the library: see `hapticeval.extras`.
    assert re.search(r"pip install (--editable '.*\[cluster\]'|'distributed)", capsys.readouterr().err)


def test_without_a_scheduler_the_library_is_not_loaded(here):
    code = (
        "import sys; from hapticeval import api; import noisy;"
        "api.run(noisy.Noisy, suites='many.toml', select='slide-1', workers=0);"
        "print(sorted({'distributed', 'dask', 'cloudpickle'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=here)
    assert done.stdout.strip() == "[]"


def outcomes(folder):
    file = folder / "out" / OUTCOMES
    return len(file.read_bytes().splitlines()) if file.exists() else 0


def killed_and_resumed(folder, kills, cases):
    """Kill workers, the scheduler or the client, each some outcomes after the last; start again what was killed."""
    many_jobs.write(folder, cases)
    renderers = ["noisy:Slow", "noisy:Noisy"]
    sys.path.insert(0, str(folder))
    whole = api.run(renderers, suites=str(folder / "many.toml"), output=folder / "whole", workers=2)
    sys.path.remove(str(folder))
    sys.modules.pop("noisy", None)
    chance = random.Random(0)
    with Cluster(folder, 2) as cluster:
        process = many_jobs.start(*renderers, here=folder, scheduler=cluster.address)
        for kill in range(kills):
            before = outcomes(folder)
            while process.poll() is None and outcomes(folder) <= before:
                time.sleep(0.01)
            time.sleep(0.3 * chance.random())
            if (kill + 1) % 3:
                os.kill(chance.choice(cluster.pids()), signal.SIGKILL)
                continue
            victim = chance.choice([cluster.scheduler, process])
            victim.kill()
            process.communicate()
            if victim is cluster.scheduler:
                cluster.__exit__()
                cluster = Cluster(folder, 2).__enter__()
            process = many_jobs.start(*renderers, here=folder, scheduler=cluster.address)
        out = process.communicate()[0]
        cluster.__exit__()
    if not read_results(folder / "out").complete:
        raise AssertionError(out)
    assert many_jobs.found(folder / "out") == many_jobs.found(whole.folder)


def test_what_is_killed_costs_no_result(tmp_path):
    killed_and_resumed(tmp_path, kills=3, cases=30)


@pytest.mark.slow
def test_twenty_kills_of_workers_scheduler_and_client_cost_no_result(tmp_path):
    killed_and_resumed(tmp_path, kills=20, cases=400)


@pytest.mark.slow
def test_a_job_that_kills_its_worker_again_and_again_is_one_error(here, cluster):
    (here / "killed").unlink(missing_ok=True)
    options = {"suites": "many.toml", "select": ["slide-0", "slide-3"], "scheduler": cluster.address}
    results = api.run(["noisy:Noisy", "noisy:KillsWorker"], output="out", **options)
    assert results.complete, results.document.reason
    broken = [verdict for verdict in results.verdicts if verdict.outcome is Outcome.ERROR]
    assert {verdict.renderer for verdict in broken} == {"noisy:KillsWorker"}
    assert len(broken) == results.document.planned / 2


def test_the_script_starts_a_cluster_runs_on_it_and_ends_it(here):
    script = Path(__file__).parents[2] / "examples" / "cluster.sh"
    arguments = ["run", "many.toml", "-r", "noisy:Noisy", "-k", "slide-1", "-o", "by-script"]
    environment = {**os.environ, "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}", "PYTHONPATH": str(here)}
    done = subprocess.run(
        ["sh", script, *arguments], capture_output=True, text=True, cwd=here, env=environment, check=False
    )
    assert done.returncode in (0, 1), done.stderr
    assert read_results(here / "by-script").complete
    local = run("local", workers=0, select=["slide-1"])
    assert read_results(here / "by-script").verdicts == [
        verdict for verdict in local.verdicts if verdict.renderer == "noisy:Noisy"
    ]
