"""Processes that call one function for whoever asks, a call at a time each, and that can be stopped at once.

A process pool cannot do the last: it neither says which calls have really begun, nor survives the end of one of its
processes. Here each process has a pipe of its own and shares no lock, so that one that dies, or is killed in the middle
of an answer, takes nothing along but its call.
"""

from __future__ import annotations

import multiprocessing
import multiprocessing.connection
import os
import pickle
import signal
import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from typing import Any, Generic, NamedTuple, TypeVar, cast

T = TypeVar("T")

GRACE = 1.0
"""Seconds that a process without a call has to end by itself, before it is killed."""


def cores() -> int:
    """How many processors this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class Ended(Exception):
    """The process that worked on a call has ended without an answer; `how` in words, as "SIGSEGV"."""

    def __init__(self, how: str = "") -> None:
        super().__init__(how)
        self.how = how


class Overdue(Exception):
    """The process that worked on a call was killed: it took longer than it was given."""


def ending(code: int | None) -> str:
    """Return how a process ended, in words: the name of the signal that killed it, or its exit code."""
    if code is not None and code < 0:
        try:
            return signal.Signals(-code).name
        except ValueError:
            return f"signal {-code}"
    return f"exit code {code}"


class Answer(NamedTuple, Generic[T]):
    """What came of call number `call`: a value, or the error that it raised.

    That is `Ended` where its process is gone, and `Overdue` where it had to be killed.
    """

    call: int
    value: T | None
    error: Exception | None


@dataclass(frozen=True)
class _Worker:
    process: BaseProcess
    pipe: Connection


@dataclass(frozen=True)
class _Call:
    worker: _Worker
    begun: float


class Workers(Generic[T]):
    """Up to `count` processes that call `function`; leaving the `with` ends them, whatever they are at.

    They ignore Ctrl-C, which reaches the whole process group: only the parent decides what it means. With a count of 0
    a call is made here and now: Ctrl-C then ends it as anywhere.
    """

    def __init__(self, function: Callable[..., T], count: int) -> None:
        self._function = function
        self._count = count
        self._idle: list[_Worker] = []
        self._at: dict[int, _Call] = {}
        self._here: list[Answer[T]] = []

    def __enter__(self) -> Workers[T]:
        return self

    def __exit__(self, *_: object) -> None:
        for call in self._at.values():
            _kill(call.worker)
        for worker in self._idle:
            worker.pipe.close()
        for worker in self._idle:
            worker.process.join(GRACE)
            _kill(worker)
        self._at.clear()
        self._idle.clear()

    @property
    def busy(self) -> int:
        """How many calls have begun, of which no answer has been taken."""
        return len(self._at) + len(self._here)

    @property
    def free(self) -> int:
        """How many more calls may begin now."""
        return max(self._count, 1) - self.busy

    def begin(self, call: int, *arguments: Any) -> None:
        """Have a free process, or a new one, call the function."""
        if self._count == 0:
            self._here.append(Answer(call, *_called(partial(self._function, *arguments))))
            return
        while True:
            worker = self._idle.pop() if self._idle else self._new()
            try:
                worker.pipe.send(arguments)
            except OSError:  # it ended while it had nothing to do
                _kill(worker)
                continue
            except Exception:  # the arguments cannot travel, and nothing of them was sent
                self._idle.append(worker)
                raise
            self._at[call] = _Call(worker, time.monotonic())
            return

    def answers(self, timeout: float | None = None) -> list[Answer[T]]:
        """Return the answers that there are, after waiting for the first, for at most `timeout` seconds if given."""
        found, self._here = self._here, []
        calls = {begun.worker.pipe: call for call, begun in self._at.items()}
        for pipe in multiprocessing.connection.wait(list(calls), timeout) if calls else ():
            call = calls[cast("Connection", pipe)]
            worker = self._at.pop(call).worker
            try:
                answer = worker.pipe.recv_bytes()
            except (EOFError, OSError):  # in the middle of an answer, or before
                worker.process.join(GRACE)
                how = ending(worker.process.exitcode)
                _kill(worker)
                found.append(Answer(call, None, Ended(how)))
            else:
                self._idle.append(worker)
                found.append(Answer(call, *pickle.loads(answer)))
        return found

    def give_up(self, seconds: float) -> list[Answer[T]]:
        """Kill the processes that have worked on a call for longer than `seconds`; return an answer for each."""
        now = time.monotonic()
        late = [call for call, at in self._at.items() if now - at.begun > seconds]
        for call in late:
            _kill(self._at.pop(call).worker)
        return [Answer(call, None, Overdue()) for call in late]

    def _new(self) -> _Worker:
        ours, theirs = multiprocessing.Pipe()
        process = multiprocessing.Process(target=_serve, args=(theirs, ours, self._function))
        process.start()
        theirs.close()
        return _Worker(process, ours)


def _kill(worker: _Worker) -> None:
    worker.pipe.close()
    worker.process.kill()
    worker.process.join()


def _serve(pipe: Connection, others: Connection, function: Callable[..., Any]) -> None:
    """Answer calls until the other end of the pipe is closed; it closes as well when the parent dies."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    others.close()  # else this process would keep its own pipe open
    try:
        while True:
            received = pipe.recv_bytes()
            pipe.send_bytes(_packed(*_called(lambda: function(*pickle.loads(received)))))  # noqa: B023 - called at once
    except (EOFError, BrokenPipeError, ConnectionResetError):
        return


def _called(call: Callable[[], T]) -> tuple[T | None, Exception | None]:
    """Return the value, or the error that was raised."""
    try:
        return call(), None
    except Exception as error:
        return None, error


def _packed(value: Any, error: Exception | None) -> bytes:
    """Return value and error, ready to travel; what cannot becomes an error with its traceback as text."""
    try:
        if error is None:
            return pickle.dumps((value, None))
    except Exception as raised:
        error = raised
    text = "".join(traceback.format_exception(error))
    error.add_note(f"in another process:\n{text}")
    try:
        answer = pickle.dumps((None, error))
        pickle.loads(answer)
    except Exception:
        answer = pickle.dumps((None, RuntimeError(text)))
    return answer
