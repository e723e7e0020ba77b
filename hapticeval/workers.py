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
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any, Generic, NamedTuple, TypeVar, cast

T = TypeVar("T")

GRACE = 1.0
"""Seconds that a process without a call has to end by itself, before it is killed."""


def cores() -> int:
    """How many processors this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _scheduled(pid: int | None) -> Path:
    return Path(f"/proc/{pid}/schedstat")


class Ended(Exception):
    """The process that worked on a call has ended without an answer."""


class Answer(NamedTuple, Generic[T]):
    """What came of call number `call`: a value, or the error that it raised, `Ended` where its process is gone."""

    call: int
    value: T | None
    error: Exception | None


@dataclass(frozen=True)
class _Worker:
    process: BaseProcess
    pipe: Connection


class Workers(Generic[T]):
    """Up to `count` processes that call `function`; leaving the `with` ends them, whatever they are at.

    They ignore Ctrl-C, which reaches the whole process group: only the parent decides what it means. With a count of 0
    a call is made here and now: Ctrl-C then ends it as anywhere.
    """

    def __init__(self, function: Callable[..., T], count: int) -> None:
        self._function = function
        self._count = count
        self._idle: list[_Worker] = []
        self._at: dict[int, _Worker] = {}
        self._here: list[Answer[T]] = []

    def __enter__(self) -> Workers[T]:
        return self

    def __exit__(self, *_: object) -> None:
        for worker in self._at.values():
            _kill(worker)
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
            self._at[call] = worker
            return

    def answers(self, timeout: float | None = None) -> list[Answer[T]]:
        """Return the answers that there are, after waiting for the first, for at most `timeout` seconds if given."""
        found, self._here = self._here, []
        calls = {worker.pipe: call for call, worker in self._at.items()}
        for pipe in multiprocessing.connection.wait(list(calls), timeout) if calls else ():
            call = calls[cast("Connection", pipe)]
            worker = self._at.pop(call)
            try:
                answer = worker.pipe.recv_bytes()
            except (EOFError, OSError):  # in the middle of an answer, or before
                _kill(worker)
                found.append(Answer(call, None, Ended()))
            else:
                self._idle.append(worker)
                found.append(Answer(call, *pickle.loads(answer)))
        return found

    def starved(self, call: int) -> float:
        """Return the seconds that the process at a call has spent waiting for a processor, where the system counts it.

        What shares a machine with others is late for them: who waits for an answer need not count that. 0.0 where it is
        not known, and for a call that is answered.
        """
        worker = self._at.get(call)
        try:
            return 0.0 if worker is None else 1e-9 * int(_scheduled(worker.process.pid).read_text().split()[1])
        except (OSError, ValueError, IndexError):
            return 0.0

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
