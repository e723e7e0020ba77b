"""The processes that do the jobs: what they answer, and what is left when one dies, is killed, or loses its parent."""

from __future__ import annotations

import contextlib
import ctypes
import linecache
import os
import pickle
import select
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from hapticeval import workers
from hapticeval.pulse import note_pending
from hapticeval.workers import Answer, Overdue, ProcessEnded, Workers


class Untold(Exception):
    """Cannot be pickled back, also where dask has taught pickle exceptions whose arguments are not those of making."""

    def __reduce__(self):
        return int, ("no number",)


def act(what, *more):
    """What the processes are asked to do here."""
    if what == "double":
        return 2 * more[0]
    if what == "pid":
        return os.getpid()
    if what == "wait":
        for begun in more:
            begun.touch()
        time.sleep(3600.0)
    if what == "hang":
        note_pending(*more)
        time.sleep(3600.0)
    if what == "spin":
        while True:
            pass
    if what == "fork":
        # Both come back from the call, the copy somewhat later: when its parent is at the next one.
        if os.fork() == 0:
            time.sleep(0.1)
        return os.getpid()
    if what == "print":
        print("::error::", end="\x1b[2J\n")
        os.write(2, b"x" * more[0] + b"\n")
        return sys.stdout.isatty()
    if what == "print and die":
        os.write(1, b"on the way out\n")
        os._exit(3)
    if what == "hold back":
        # Neither Python nor C sends a line on before it ends, or there are 4 kB of it.
        print("by Python; ", end="")
        ctypes.CDLL(None).printf(b"by C; ")
        return None
    if what == "print later":
        threading.Timer(more[0], lambda: os.write(1, b"too late\n")).start()
        return None
    if what == "chatter":
        while True:
            os.write(1, b"again and " * 1000)
    if what == "pause":
        time.sleep(0.3)
        return os.getpid()
    if what == "die":
        os.kill(os.getpid(), signal.SIGKILL)
    if what == "untold":
        raise Untold("one")
    if what == "function":
        return lambda: None
    raise ValueError(what)


def answered(crew, calls):
    """Every answer of so many calls, by number."""
    found = {}
    while len(found) < calls:
        found.update({answer.call: answer for answer in crew.answers(60.0)})
    return found


def test_calls_are_answered_by_as_many_processes_as_there_are():
    with Workers(act, 2) as crew:
        assert (crew.free, crew.busy) == (2, 0)
        for call in range(2):
            crew.begin(call, "pid")
        assert (crew.free, crew.busy) == (0, 2)
        pids = {answer.value for answer in answered(crew, 2).values()}
        for call in range(2, 4):
            crew.begin(call, "pid")
        again = {answer.value for answer in answered(crew, 2).values()}
    assert len(pids) == 2
    assert again == pids
    assert os.getpid() not in pids


def test_an_answer_that_is_not_there_yet_is_not_waited_for():
    with Workers(act, 1) as crew:
        crew.begin(0, "wait")
        assert crew.answers(0.0) == []
        assert crew.busy == 1


@pytest.mark.parametrize(
    ("what", "kind", "words"),
    [
        ("error", ValueError, "error"),
        ("untold", RuntimeError, "Untold: one"),
        ("function", Exception, "lambda"),
    ],
)
def test_an_error_says_where_it_was_raised(what, kind, words):
    with Workers(act, 1) as crew:
        crew.begin(0, what)
        error = answered(crew, 1)[0].error
        assert isinstance(error, kind)
        assert words in str(error)
        assert what == "untold" or "in another process:\nTraceback" in error.__notes__[0]
        crew.begin(1, "double", 4)
        assert answered(crew, 1)[1] == Answer(1, 8, None)


def test_a_copy_that_a_call_makes_of_its_process_answers_nothing():
    with Workers(act, 1) as crew:
        crew.begin(0, "fork")
        pid = answered(crew, 1)[0].value
        for call in (1, 2):
            crew.begin(call, "pause")
            assert answered(crew, 1) == {call: Answer(call, pid, None)}


def test_an_answer_of_another_call_is_refused():
    with Workers(act, 1) as crew:
        crew.begin(0, "pause")
        call = crew._begun[0]
        crew._begun[0] = call._replace(serial=b"\xff" * len(call.serial))
        assert crew.answers(2.0) == []
        assert crew.busy == 1, "its own is waited for"


def test_what_a_process_prints_comes_with_its_answer_and_goes_nowhere_else(capfd):
    with Workers(act, 2, captures=True) as crew:
        crew.begin(0, "print", 3)
        crew.begin(1, "print and die")
        answers = {}
        while crew.busy:
            answers |= {answer.call: answer for answer in crew.answers()}
        # More than a pipe holds, of which the end is kept.
        crew.begin(2, "print", 10**6)
        (large,) = crew.answers()
    assert answers[0][1:] == (False, None, "::error::\x1b[2J\nxxx\n")
    assert (answers[1].error.code, answers[1].printed) == (3, "on the way out\n")
    assert large.printed.endswith("x\n")
    assert workers.PRINTED_KEPT < len(large.printed) < workers.PRINTED_KEPT + 100
    assert large.printed.startswith(f"({10**6 + 15 - workers.PRINTED_KEPT:,} bytes before this are left out)\n")
    assert capfd.readouterr() == ("", "")


def test_what_is_held_back_comes_with_the_answer_of_its_call():
    with Workers(act, 1, captures=True) as crew:
        crew.begin(0, "hold back")
        assert {*answered(crew, 1)[0].printed.split("; ")} == {"", "by Python", "by C"}
        crew.begin(1, "double", 4)
        assert answered(crew, 1)[1] == Answer(1, 8, None)


def test_what_comes_between_two_calls_is_said_to_be_of_neither():
    with Workers(act, 1, captures=True) as crew:
        crew.begin(0, "print later", 0.05)
        assert answered(crew, 1)[0].printed == ""
        time.sleep(0.5)
        crew.begin(1, "print", 3)
        printed = answered(crew, 1)[1].printed
        assert printed == f"({workers.STRAY_WORDS})\ntoo late\n(in this call)\n::error::\x1b[2J\nxxx\n"
        crew.begin(2, "double", 4)
        assert answered(crew, 1)[2] == Answer(2, 8, None)


def test_who_prints_without_end_is_given_up_in_time():
    with Workers(act, 1, captures=True) as crew:
        crew.begin(0, "chatter")
        assert crew.answers(0.2) == []
        # A process that waits for a processor is given its time.
        while not (given_up := crew.give_up(0.1)):
            assert crew.answers(0.1) == []
    (answer,) = given_up
    assert isinstance(answer.error, Overdue)
    assert len(answer.printed) >= workers.PRINTED_KEPT


def test_without_processes_a_call_is_made_here_and_now():
    with Workers(act, 0) as crew:
        crew.begin(0, "pid")
        assert (crew.free, crew.busy) == (0, 1)
        assert crew.answers() == [Answer(0, os.getpid(), None)]
        crew.begin(1, "error")
        assert isinstance(crew.answers()[0].error, ValueError)
        assert crew.free == 1


def test_a_process_that_dies_takes_its_call_alone():
    with Workers(act, 2) as crew:
        crew.begin(0, "die")
        crew.begin(1, "double", 1)
        found = answered(crew, 2)
        assert isinstance(found[0].error, ProcessEnded)
        assert found[1].value == 2
        for call in (2, 3):
            crew.begin(call, "double", call)
        assert {call: answer.value for call, answer in answered(crew, 2).items()} == {2: 4, 3: 6}


def test_a_process_that_dies_in_idleness_is_replaced():
    with Workers(act, 1) as crew:
        crew.begin(0, "pid")
        pid = answered(crew, 1)[0].value
        os.kill(pid, signal.SIGKILL)
        os.waitid(os.P_PID, pid, os.WEXITED | os.WNOWAIT)
        crew.begin(1, "pid")
        assert answered(crew, 1)[1].value not in (None, pid)


def begin_to_wait(crew, calls, folder):
    """Begin calls that never end, and return when their processes are within them."""
    for call in calls:
        crew.begin(call, "wait", folder / str(call))
    while not all((folder / str(call)).exists() for call in calls):
        assert crew.answers(0.01) == []


def test_a_call_that_takes_too_long_is_given_up_and_its_place_is_free(tmp_path):
    with Workers(act, 1) as crew:
        begin_to_wait(crew, [0], tmp_path)
        assert crew.give_up(60.0) == []
        while not (given_up := crew.give_up(0.05)):
            assert crew.answers(0.05) == []
        (late,) = given_up
        assert (late.call, late.value, type(late.error)) == (0, None, Overdue)
        file, line, function = late.error.stack[-1]
        assert (file, function) == (__file__, "act")
        assert linecache.getline(file, line).strip() == "time.sleep(3600.0)"
        assert crew.busy == 0
        crew.begin(1, "double", 4)
        assert answered(crew, 1)[1].value == 8


def test_a_call_that_is_given_up_tells_the_step_that_was_asked_for():
    with Workers(act, 1) as crew:
        crew.begin(0, "hang", 7, (0.01, 0.02))
        assert crew.answers(0.5) == []
        while not (given_up := crew.give_up(0.05)):
            assert crew.answers(0.05) == []
    assert given_up[0].error.pending_step == (7, (0.01, 0.02))


def test_a_stack_is_waited_for_no_longer_than_it_takes_to_write_it(monkeypatch, tmp_path):
    monkeypatch.setattr(workers, "STACK_PATIENCE", 3600.0)
    with Workers(act, 4) as crew:
        begin_to_wait(crew, range(4), tmp_path)
        given_up = crew.give_up(0.0)
    # a process may still be within `touch`: its file is there before that returns
    assert [any(function == "act" for _, _, function in late.error.stack) for late in given_up] == [True] * 4


def test_a_stack_that_is_not_written_to_its_end_is_waited_for_no_longer_than_that(monkeypatch, tmp_path):
    monkeypatch.setattr(workers, "STACK_PATIENCE", 0.1)
    monkeypatch.setattr(workers, "STACK_SIGNAL", None)
    with Workers(act, 1) as crew:
        begin_to_wait(crew, [0], tmp_path)
        # On a busy machine the process may have had no time of its own yet.
        while not (given_up := crew.give_up(0.0)):
            time.sleep(0.01)
    assert [late.error.stack for late in given_up] == [()]


def test_an_interpreter_of_its_own_shows_its_stack_too(tmp_path):
    with Workers(act, 1, fresh=True) as crew:
        crew.begin(0, "double", 1)
        assert answered(crew, 1)[0].value == 2
        begin_to_wait(crew, [1], tmp_path)
        while not (given_up := crew.give_up(0.05)):
            assert crew.answers(0.05) == []
        assert [function for _, _, function in given_up[0].error.stack][-1] == "act"


def test_an_ended_process_has_a_cause():
    with Workers(act, 1) as crew:
        crew.begin(0, "die")
        assert answered(crew, 1)[0].error.how == "SIGKILL"


def test_a_process_that_is_stopped_in_the_middle_of_an_answer_does_not_hold_up_the_end():
    """The answer is larger than a pipe takes, so that its process stands in the middle of sending it."""
    with Workers(act, 2) as crew:
        crew.begin(0, "double", "x" * 10_000_000)
        crew.begin(1, "wait")
        assert crew._begun[0].worker.pipe.poll(60.0)
    assert crew.busy == 0


def test_what_a_process_waits_for_a_processor_is_known_while_it_is_at_a_call():
    with Workers(act, 1) as crew:
        assert crew.starved(0) == 0.0
        crew.begin(0, "wait")
        first = crew.starved(0)
        assert 0.0 <= first <= crew.starved(0)


ORPHANS = """
import os, sys
from hapticeval.workers import Workers
with Workers(os.getpid, 2) as crew:
    found = []
    for call in (0, 1):
        crew.begin(call)
    while len(found) < 2:
        found += [answer.value for answer in crew.answers(60.0)]
    print(*found, flush=True)
    os.kill(os.getpid(), 9)
"""


def test_processes_end_when_their_parent_is_killed():
    with subprocess.Popen([sys.executable, "-c", ORPHANS], stdout=subprocess.PIPE, text=True) as parent:
        pids = [int(word) for word in parent.stdout.readline().split()]
        # The pipe to here ends when the last process that holds it has ended.
        assert parent.stdout.read() == ""
    assert len(pids) == 2
    assert parent.returncode == -signal.SIGKILL


class Unread:
    """Can be sent, and not be made again on the other side."""

    def __reduce__(self):
        return int, ("no number",)


def test_what_cannot_travel_costs_no_process():
    with Workers(act, 1) as crew:
        crew.begin(0, "pid")
        pid = answered(crew, 1)[0].value
        with pytest.raises((pickle.PicklingError, AttributeError, TypeError)):
            crew.begin(1, "double", lambda: None)
        crew.begin(2, "double", Unread())
        assert isinstance(answered(crew, 1)[2].error, ValueError)
        crew.begin(3, "pid")
        assert answered(crew, 1)[3].value == pid


def killed(file, times):
    """Be killed, so many times, as by the system."""
    with Path(file).open("a+") as log:
        log.write("x")
        log.seek(0)
        if len(log.read()) <= times:
            log.flush()
            os.kill(os.getpid(), signal.SIGKILL)
    return "done"


@pytest.mark.parametrize("fresh", [False, True])
@pytest.mark.parametrize(("times", "value"), [(2, "done"), (3, None)])
def test_a_call_whose_process_is_killed_is_made_again_a_few_times(tmp_path, fresh, times, value):
    with Workers(killed, 1, tries=3, fresh=fresh) as crew:
        crew.begin(0, str(tmp_path / "log"), times)
        (answer,) = crew.answers()
        assert answer.value == value
        assert value or answer.error.killed
    assert (tmp_path / "log").read_text() == "xxx"


def test_a_crash_is_no_kill():
    with Workers(os._exit, 1, tries=3, fresh=True) as crew:
        crew.begin(0, 7)
        (answer,) = crew.answers()
    assert (answer.error.code, answer.error.killed) == (7, False)


def test_processes_of_their_own_end_when_their_parent_is_killed():
    program = ORPHANS.replace("Workers(os.getpid, 2)", "Workers(os.getpid, 2, fresh=True)")
    with subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, text=True) as parent:
        assert len(parent.stdout.readline().split()) == 2
        assert parent.stdout.read() == ""


def hang(pipe):
    """Have a process of this process's own hang in a call, and hang as well; `pipe` is held by both."""
    with Workers(act, 1) as crew:
        crew.begin(0, "pid")
        os.write(pipe, b"%d\n" % answered(crew, 1)[0].value)
        crew.begin(1, "spin")
        crew.answers()


def test_a_call_that_hangs_ends_with_the_process_that_asked_for_it():
    """The worker is killed, as it is in a call, and so cannot end the worker that it has itself."""
    ours, theirs = os.pipe()
    with Workers(hang, 1) as crew:
        crew.begin(0, theirs)
        grandchild = int(os.read(ours, 100))
        os.close(theirs)
    try:
        assert select.select([ours], [], [], 20.0)[0], "it spins on"
        assert os.read(ours, 1) == b""
    finally:
        os.close(ours)
        with contextlib.suppress(ProcessLookupError):
            os.kill(grandchild, signal.SIGKILL)
