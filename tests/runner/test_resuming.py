"""A run that is killed goes on where it was, and finds what it would have found at once; another is refused."""

from __future__ import annotations

import os
import random
import shutil
import signal
import sys
import time
from contextlib import contextmanager

import many_jobs
import pytest

from hapticeval import api
from hapticeval.cli import main
from hapticeval.errors import InputError
from hapticeval.phenomena.verdict import Outcome
from hapticeval.runner.events import JobFinished, RunStarted
from hapticeval.runner.resuming import OUTCOMES, read_outcomes

RENDERERS = ("noisy:Noisy", "noisy:Other")


@contextmanager
def six_cases(folder):
    """Make a folder with six cases and a module of renderers the current one."""
    many_jobs.write(folder, 6)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        patch.syspath_prepend(str(folder))
        yield folder
        sys.modules.pop("noisy", None)


@pytest.fixture
def here(tmp_path):
    with six_cases(tmp_path) as folder:
        yield folder


def run(output, *, workers=0, renderers=RENDERERS, suites="many.toml", **options):
    return api.run(list(renderers), suites=suites, output=output, workers=workers, **options)


@pytest.fixture(scope="module")
def begun(tmp_path_factory):
    """A folder in which a run was killed after five outcomes, before it has written results of any of them."""
    finished = []

    def stop(event):
        finished.extend([event] * isinstance(event, JobFinished))
        if len(finished) == 5:
            raise RuntimeError("killed")

    with six_cases(tmp_path_factory.mktemp("begun")) as folder:
        with pytest.raises(RuntimeError):
            run("out", watch=stop)
        return folder / "out"


@pytest.fixture
def folder(here, begun):
    """The same, to go on with."""
    shutil.copytree(begun, here / "out")
    assert len(read_outcomes(here / "out")) == 5
    return here / "out"


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """What a run finds that is not killed."""
    with six_cases(tmp_path_factory.mktemp("whole")):
        return many_jobs.found(run("out").folder)


def test_what_was_finished_is_not_run_again_and_the_rest_is(folder, whole):
    events = []
    run("out", resume=True, watch=events.append)
    assert events[0] == RunStarted(24, 12, kept_jobs=5, jobs_of={"many": 7})
    assert sum(isinstance(each, JobFinished) for each in events) == 7
    assert many_jobs.found(folder) == whole
    assert not (folder / OUTCOMES).exists(), "all of it is in results.json"
    run("out", resume=True, watch=events.append)
    assert many_jobs.found(folder) == whole


def test_what_a_resumed_run_took_counts_what_it_took_before(here):
    before = run("out").document.timing
    timing = run("out", resume=True).document.timing
    assert timing.simulated_seconds == before.simulated_seconds
    assert timing.wall_seconds >= before.wall_seconds


@pytest.mark.parametrize("tail", [b'{"run": {"suite": "many", "ca', b"\n\n{}\n", b"\xff\x00\n"])
def test_a_line_that_was_cut_or_damaged_is_no_outcome(folder, whole, tail):
    with (folder / OUTCOMES).open("ab") as file:
        file.write(tail)
    assert len(read_outcomes(folder)) == 5
    assert (folder / OUTCOMES).read_bytes().endswith(b"\n"), "what is added next is a line of its own"
    run("out", resume=True)
    assert many_jobs.found(folder) == whole


def test_a_job_whose_recording_is_gone_is_run_again(folder, whole):
    next((folder / "recordings").rglob("*.h5")).unlink()
    events = []
    run("out", resume=True, watch=events.append)
    assert events[0].kept_jobs == 4
    assert many_jobs.found(folder) == whole


def test_where_nothing_was_begun_it_begins(here):
    assert run("out", resume=True).complete


def test_without_it_a_run_begins_anew(folder):
    events = []
    run("out", watch=events.append)
    assert events[0].kept_jobs == 0
    assert not (folder / OUTCOMES).exists()


@pytest.mark.parametrize(
    "changes",
    [
        {"seed": 1},
        {"strict": True},
        {"renderers": RENDERERS[:1]},
        {"select": ["slide-1"]},
        {"shard": "1/2"},
    ],
)
def test_another_run_is_not_gone_on_with(refused, folder, changes):
    with refused(InputError):
        run("out", resume=True, **changes)
    assert len(read_outcomes(folder)) == 5


def test_nor_is_one_of_another_suite_or_version(refused, here, folder):
    text = (folder / "results.json").read_text()
    (folder / "results.json").write_text(text.replace('"hapticeval": "', '"hapticeval": "9.'))
    with refused(InputError):
        run("out", resume=True)
    (folder / "results.json").write_text(text)
    suite = here / "many.toml"
    suite.write_text(suite.read_text().replace("0.02", "0.03", 1))
    with refused(InputError):
        run("out", resume=True)


def test_there_has_to_be_a_folder(refused, here):
    with refused(InputError):
        run(None, resume=True)


@pytest.mark.system
@pytest.mark.parametrize("workers", [1, 2, 16])
def test_verdicts_are_the_same_on_any_number_of_workers(here, workers):
    assert many_jobs.found(run("many", workers=workers).folder) == many_jobs.found(run("one").folder)


def test_a_job_does_not_depend_on_the_others(here):
    """Nor on their order: alone it finds what it finds among them."""
    among = {(*verdict.key, verdict.check): verdict for verdict in run("whole").verdicts}
    assert len({verdict.metric.value for verdict in among.values() if verdict.check == "contact-normal-force"}) > 6
    for name in reversed(RENDERERS):
        for verdict in run("alone", renderers=[name], select=["slide-3", "slide-1"]).verdicts:
            assert among[(*verdict.key, verdict.check)] == verdict


def test_a_job_that_has_its_process_killed_again_and_again_is_one_error(here):
    results = run("out", workers=2, renderers=["noisy:Killed", "noisy:Noisy"], select=["slide-0"])
    assert (here / "killed").read_text() == "xxx"
    killed = [verdict for verdict in results.verdicts if verdict.renderer == "noisy:Killed"]
    assert [verdict.outcome for verdict in killed] == [Outcome.ERROR] * 2
    assert "killed, again and again" in killed[0].message
    assert results.exit_code == 3
    assert api.Results.read("out").exit_code == 3
    assert sum(verdict.outcome is Outcome.ERROR for verdict in results.verdicts) == 2


def test_a_process_that_is_killed_from_outside_costs_nothing(here):
    results = run("out", workers=1, renderers=["noisy:KilledOnce"], select=["slide-0"])
    assert (here / "once").exists()
    assert results.complete
    assert not any(verdict.outcome is Outcome.ERROR for verdict in results.verdicts)


def killed_and_resumed(here, kills, cases):
    """Kill a run so many times, each after one more outcome or somewhat later; resume until it ends."""
    many_jobs.write(here, cases)
    chance = random.Random(0)
    run("whole", workers=2, renderers=["noisy:Slow", "noisy:Noisy"])
    arguments = ["noisy:Slow", "noisy:Noisy"]
    done = 0
    for _ in range(kills):
        with many_jobs.start(*arguments, here=here) as process:
            while process.poll() is None and len(read_lines(here)) <= done:
                time.sleep(0.005)
            time.sleep(0.1 * chance.random())
            os.killpg(process.pid, signal.SIGKILL) if chance.random() < 0.5 else process.kill()
        done = len(read_lines(here))
    with many_jobs.start(*arguments, here=here) as process:
        out = process.stdout.read()
    assert process.returncode == 0, out
    assert f"{done} run{'s' * (done > 1)} of them finished before" in out
    assert many_jobs.found(here / "out") == many_jobs.found(here / "whole")


def read_lines(here):
    file = here / "out" / OUTCOMES
    return file.read_bytes().splitlines() if file.exists() else []


@pytest.mark.system
def test_a_run_that_was_killed_finds_what_it_would_have_found(here):
    killed_and_resumed(here, kills=1, cases=20)


@pytest.mark.slow
def test_a_run_that_was_killed_twenty_times_finds_what_it_would_have_found(here):
    killed_and_resumed(here, kills=20, cases=600)


@pytest.mark.usefixtures("in_process", "undrawn")
def test_the_command_resumes(folder, capsys):
    assert main(["run", "many.toml", *(f"-r{name}" for name in RENDERERS), "-o", "out", "--resume"]) in (0, 1)
    out, err = capsys.readouterr()
    assert "12 runs, 24 verdicts planned, 5 runs of them finished before" in err
    assert "24 of 24 planned verdicts ran" in out
    assert main(["run", "many.toml", "-rnoisy:Noisy", "-o", "out", "--resume"]) == 2
