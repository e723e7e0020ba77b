"""Processes that make calls of one function, one call at a time each, and that can be stopped at once.

A pool of the standard library cannot do the last: it neither says which calls have really begun, nor survives the end
of one of its processes.

Here each process has a pipe of its own and shares no lock. One that dies, or is killed in the middle of an answer,
takes nothing along but its call. A copy that a renderer makes of its process, by a fork, has no part in the pipe: else
it would answer calls as well. One that hangs writes its stack at a signal before it is killed, in which
`errors.place_in_stack` finds the line of the renderer.
"""

from __future__ import annotations

import contextlib
import ctypes
import faulthandler
import math
import multiprocessing
import multiprocessing.connection
import os
import pickle
import re
import signal
import subprocess
import sys
import threading
import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from multiprocessing.reduction import ForkingPickler
from pathlib import Path
from typing import Any, Generic, NamedTuple, Protocol, Self, TypeAlias, TypeVar

from hapticeval.errors import HapticevalError
from hapticeval.pulse import PENDING_SIZE, PendingStep, Pulse, share_pulse, unanswered_step

T = TypeVar("T")

Frame: TypeAlias = tuple[str, int, str]
"""File, line and function."""

IDLE_GRACE = 1.0
"""Seconds that a process without a call has to end by itself, before it is killed."""

EXIT_PATIENCE = 10.0
"""Seconds that a process has until it is gone whose pipe is closed: longer than the system takes, also a busy one."""

STACK_SIGNAL = getattr(signal, "SIGUSR1", None)
"""At this signal a process writes its Python stack, even from within compiled code."""

STACK_PATIENCE = 2.0
"""Seconds that processes have to write their stacks, on a machine with other work; mostly a hundredth is enough."""

TRIES = 3
"""Processes that a job may see killed from outside before it counts as what has them killed."""

PRINTED_KEPT = 1 << 16
"""Bytes that are kept of what a process prints in a call, the last ones, and that are read of its pipe at once."""

PRINTED_READS = 16
"""Readings of that pipe before anything else is looked at: a renderer may print without end."""

STRAY_WORDS = "by what an earlier call left running in this process, before this one began"
"""What stands before such text: who waits for no thread of its own prints between two calls."""

SERIAL_SIZE = 8
"""Bytes before a call and before its answer: its number among what was sent."""

PARENT_CHECK_PERIOD = 1.0
"""Seconds between two looks of a process at whether its parent is still there."""

FORKS = hasattr(os, "fork")
"""Whether the system can copy a process, which Windows cannot."""


def cores() -> int:
    """Return how many processors this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def default_workers() -> int:
    """Return how many processes share the work where nobody says it: one for each processor.

    None where the system cannot copy a process: this one then does the work.
    """
    return cores() if FORKS else 0


def _processor_wait(worker: _Worker) -> float:
    """Return the seconds that a process has waited for a processor so far; 0.0 where it is not known."""
    try:
        # /proc/PID/schedstat: ns on a processor, ns waiting for one, and the number of turns. Linux alone has it.
        return 1e-9 * int(Path(f"/proc/{worker.process.pid}/schedstat").read_bytes().split()[1])
    except (OSError, ValueError, IndexError):
        return 0.0


class ProcessEnded(Exception):
    """The process that worked on a call has ended without an answer, with that exit `code` where it ended by itself.

    - `code`: negative for a signal, as that of `subprocess.Popen`;
    - `pending_step`: tick and HIP (m) of the step that a renderer was asked for then, if it is known;
    - `stack`: the frames of a crash, as of `Overdue`, as far as they are known.
    """

    def __init__(
        self,
        code: int | None = None,
        pending: tuple[int, tuple[float, ...]] | None = None,
        stack: tuple[Frame, ...] = (),
    ) -> None:
        super().__init__(code, pending, stack)
        self.code, self.pending_step, self.stack = code, pending, stack

    @property
    def killed(self) -> bool:
        """Whether somebody else has killed it, as the system does for lack of memory: a crash has other signals."""
        return self.code is not None and describe_exit(self.code) in ("SIGKILL", "SIGTERM")

    @property
    def how(self) -> str:
        """How it ended, in words."""
        return describe_exit(self.code)


class Overdue(Exception):
    """The process that worked on a call was killed: it took longer than it was given.

    `stack` holds file, line and function of its frames then, outermost first, below the call; it is empty where the
    system cannot tell. `pending_step` is that of `ProcessEnded`.
    """

    def __init__(
        self, stack: tuple[Frame, ...] = (), pending_step: tuple[int, tuple[float, ...]] | None = None
    ) -> None:
        super().__init__(stack, pending_step)
        self.stack, self.pending_step = stack, pending_step


class LostError(HapticevalError):
    """The processes or the cluster that were to make the calls are gone: no answer will come."""


def describe_exit(code: int | None) -> str:
    """Return how a process ended, in words: the name of the signal that killed it, or its exit code."""
    if code is not None and code < 0:
        try:
            return signal.Signals(-code).name
        except ValueError:
            return f"signal {-code}"
    return f"exit code {code}"


class Answer(NamedTuple, Generic[T]):
    """What came of call number `call`: a value, or the error that it raised.

    That is `ProcessEnded` where its process is gone, and `Overdue` where it had to be killed.
    """

    call: int
    value: T | None
    error: Exception | None
    printed: str = ""
    """What the process printed meanwhile, as far as it is captured: see `Workers`."""


class Crew(Protocol[T]):
    """What a pool offers that makes calls of one function: processes of this machine, or the workers of a cluster.

    A context manager: leaving it gives up the calls that have not been answered.
    """

    def __enter__(self) -> Self: ...

    def __exit__(self, *_: object) -> None: ...

    @property
    def busy(self) -> int:
        """How many calls have begun, of which no answer has been taken."""
        ...

    @property
    def free(self) -> int:
        """How many more calls may begin now."""
        ...

    def begin(self, call: int, *arguments: Any) -> None:
        """Begin the call of the function with these arguments, under the number `call`."""
        ...

    def answers(self, timeout: float | None = None) -> list[Answer[T]]:
        """Return the answers that there are, after waiting for the first, for at most `timeout` seconds if given.

        Raises `LostError` where none will come.
        """
        ...

    def give_up(self, seconds: float) -> list[Answer[T]]:
        """Give up the calls that were worked on for longer than `seconds`; return an answer `Overdue` for each."""
        ...

    def refused(self) -> list[tuple[str, str]]:
        """Return the workers that are given no calls any more, each once, with the reason."""
        ...


class _Printed:
    """What comes out of the pipe that a process prints into: the last `PRINTED_KEPT` bytes of a call."""

    def __init__(self, source: int) -> None:
        os.set_blocking(source, False)
        self._source = source
        self._tail = b""
        self._count = 0
        self._stray = ""

    def fileno(self) -> int:
        """Return the descriptor of the pipe, to wait for."""
        return self._source

    def read(self) -> bool:
        """Take what is there now, a little of what never ends; return whether more may come."""
        for _ in range(PRINTED_READS):
            try:
                piece = os.read(self._source, PRINTED_KEPT)
            except BlockingIOError:
                return True
            except OSError:
                return False
            if not piece:
                return False
            self._count += len(piece)
            self._tail = (self._tail + piece)[-PRINTED_KEPT:]
        return True

    def begin_call(self) -> None:
        """Set apart what came since the last answer: a thread that an earlier call left has printed it."""
        self._stray = self._take()

    def take(self) -> str:
        """Return what a call has printed, after what came before it began and is said to; begin with nothing."""
        text, stray, self._stray = self._take(), self._stray, ""
        if not stray:
            return text
        return f"({STRAY_WORDS})\n{stray.rstrip()}\n(in this call)\n{text}"

    def _take(self) -> str:
        self.read()
        text, left_out = self._tail.decode(errors="replace"), self._count - len(self._tail)
        self._tail, self._count = b"", 0
        return f"({left_out:,} bytes before this are left out)\n{text}" if left_out else text

    def close(self) -> None:
        """Close the pipe: who still prints into it gets an error."""
        if self._source >= 0:
            os.close(self._source)
        self._source = -1


@dataclass(frozen=True)
class _Worker:
    """A process that makes calls, with the pipes and the memory that it shares with this one."""

    process: BaseProcess | subprocess.Popen[bytes]
    pipe: Connection
    stack_pipe: Connection
    """Where its stack comes out."""
    pulse: Pulse
    """Where it counts the answers of renderers, unless it has an interpreter of its own."""
    pending_step: PendingStep
    """Where it keeps what is asked of a renderer, likewise."""
    printed: _Printed | None = None
    """What it prints, where that is captured."""

    def take_printed(self) -> str:
        """Return what it has printed since it was asked last."""
        return "" if self.printed is None else self.printed.take()

    def ask_for_stack(self) -> None:
        """Ask the process to write the stack of its Python code."""
        if STACK_SIGNAL is not None and self.process.pid is not None:
            with contextlib.suppress(OSError):
                os.kill(self.process.pid, STACK_SIGNAL)

    def stack(self, until: float) -> tuple[Frame, ...]:
        """Return the stack that the process writes until then: outermost frame first, below the call; else empty."""
        text = b""
        with contextlib.suppress(OSError):
            # faulthandler writes in pieces, innermost frame first, and says nowhere that it is done. The frame of
            # `_serve` is the last that matters; where it never comes, as in a very deep stack, the time decides.
            while not _frames_of_call(text)[1] and self.stack_pipe.poll(max(0.0, until - time.monotonic())):
                piece = os.read(self.stack_pipe.fileno(), 1 << 16)
                if not piece:
                    break
                text += piece
        frames, _ = _frames_of_call(text)
        return tuple(reversed(frames))

    def end(self, patience: float) -> int | None:
        """Close the pipes and kill the process after `patience` (s); return the exit code if it ended before."""
        self.pipe.close()
        self.stack_pipe.close()
        if self.printed is not None:
            self.printed.close()
        # Popen and BaseProcess do the same under different names.
        if isinstance(self.process, subprocess.Popen):
            try:
                return self.process.wait(patience)
            except subprocess.TimeoutExpired:
                self.process.kill()
                self.process.wait()
                return None
        self.process.join(patience)
        # Read before the kill: None where it had not ended by itself.
        code = self.process.exitcode
        self.process.kill()
        self.process.join()
        return code


class _Call(NamedTuple):
    """A call that has begun: who is at it since when, and how many processes were killed over it before.

    `serial` counts what was sent: only an answer that carries it is this call's. `waited` (s) is what the process had
    waited for a processor by then.
    """

    serial: bytes
    worker: _Worker
    arguments: tuple[Any, ...]
    killed: int
    begun: float
    waited: float


class Workers(Generic[T]):
    """Up to `count` processes that call `function`; leaving the `with` ends them, whatever they are at.

    They ignore Ctrl-C, which reaches the whole process group: only the parent decides what it means. With a count of 0
    a call is made here and now: Ctrl-C then ends it as anywhere.

    A call whose process is killed from outside is made again by another one, until `tries` have been killed over it. A
    process that crashes ends its call, and every process ends with its parent.

    With `fresh` each process has an interpreter of its own, for where forks are forbidden or the parent has threads;
    the function is one that can be pickled.

    With `captures` an answer brings what its process printed, by Python or by compiled code: the last `PRINTED_KEPT`
    bytes. Elsewhere, and with a count of 0, it goes where this process prints.
    """

    def __init__(
        self, function: Callable[..., T], count: int, *, tries: int = 1, fresh: bool = False, captures: bool = False
    ) -> None:
        self._function = function
        self._count = count
        self._tries = tries
        self._fresh = fresh
        self._captures = captures
        self._idle: list[_Worker] = []
        self._begun: dict[int, _Call] = {}
        self._sent = 0
        self._local_answers: list[Answer[T]] = []

    def __enter__(self) -> Workers[T]:
        return self

    def __exit__(self, *_: object) -> None:
        # What works is killed at once; who waits is told first, all of them, and then waited for.
        for call in self._begun.values():
            call.worker.end(0.0)
        for worker in self._idle:
            worker.pipe.close()
        for worker in self._idle:
            worker.end(IDLE_GRACE)
        self._begun.clear()
        self._idle.clear()

    @property
    def busy(self) -> int:
        """How many calls have begun, of which no answer has been taken."""
        return len(self._begun) + len(self._local_answers)

    @property
    def free(self) -> int:
        """How many more calls may begin now."""
        return max(self._count, 1) - self.busy

    def begin(self, call: int, *arguments: Any) -> None:
        """Have a free process, or a new one, call the function."""
        if self._count == 0:
            self._local_answers.append(Answer(call, *_call_result(partial(self._function, *arguments))))
        else:
            self._begin(call, arguments, 0)

    def _begin(self, call: int, arguments: tuple[Any, ...], killed: int) -> None:
        # By itself, and not `call`: a call that is made again must not take what came of it before.
        self._sent += 1
        serial = self._sent.to_bytes(SERIAL_SIZE, "big")
        while True:
            worker = self._idle.pop() if self._idle else self._new()
            # What the call before left there is not of this one. Before it is sent: the worker may answer at once.
            worker.pending_step[0] = 0
            if worker.printed is not None:
                worker.printed.begin_call()
            try:
                worker.pipe.send_bytes(serial + bytes(ForkingPickler.dumps(arguments)))
            except OSError:  # it ended while it had nothing to do
                worker.end(0.0)
                continue
            except Exception:  # the arguments cannot travel, and nothing of them was sent
                self._idle.append(worker)
                raise
            self._begun[call] = _Call(serial, worker, arguments, killed, time.monotonic(), _processor_wait(worker))
            return

    def answers(self, timeout: float | None = None) -> list[Answer[T]]:
        """Return the answers that there are, after waiting for the first, for at most `timeout` seconds if given."""
        # With a count of 0 the answers are here already.
        answers, self._local_answers = self._local_answers, []
        calls = {begun.worker.pipe: call for call, begun in self._begun.items()}
        for pipe in self._wait(list(calls), timeout) if calls else ():
            # A pipe is ready with an answer, or because its other end is closed: the process is gone.
            call = calls[pipe]
            serial, worker, arguments, killed, *_ = begun = self._begun.pop(call)
            try:
                answer = worker.pipe.recv_bytes()
            except (EOFError, OSError):  # in the middle of an answer, or before
                stack, pending = worker.stack(time.monotonic()), unanswered_step(worker.pending_step)
                printed = worker.take_printed()
                ended = ProcessEnded(worker.end(EXIT_PATIENCE), pending, stack)
                # Killed from outside, as for lack of memory: another process tries, so often and no more.
                if ended.killed and killed + 1 < self._tries:
                    self._begin(call, arguments, killed + 1)
                else:
                    answers.append(Answer(call, None, ended, printed))
            else:
                if answer[:SERIAL_SIZE] != serial:  # of another call: this one's is still to come
                    self._begun[call] = begun
                    continue
                self._idle.append(worker)
                value, error = pickle.loads(answer[SERIAL_SIZE:])
                answers.append(Answer(call, value, error, worker.take_printed()))
        if not answers and self._begun and timeout is None:
            return self.answers()  # what was killed has begun anew, or what came was of another call
        return answers

    def _wait(self, pipes: list[Connection], timeout: float | None) -> list[Connection]:
        """Return the pipes that are ready, after waiting for the first, for at most `timeout` seconds if given.

        What processes print meanwhile is taken: at a full pipe they would wait for ever.
        """
        end = math.inf if timeout is None else time.monotonic() + timeout
        printed: list[Any] = [
            begun.worker.printed for begun in self._begun.values() if begun.worker.printed is not None
        ]
        while True:
            left = None if timeout is None else max(0.0, end - time.monotonic())
            ready: list[Any] = multiprocessing.connection.wait([*pipes, *printed], left)
            # One that is closed at its other end is always ready: it is waited for no more.
            closed = [text for text in printed if text in ready and not text.read()]
            printed = [text for text in printed if text not in closed]
            answered = [pipe for pipe in pipes if pipe in ready]
            if answered or time.monotonic() >= end:
                return answered

    def give_up(self, seconds: float) -> list[Answer[T]]:
        """Kill the processes that have worked on a call for longer than `seconds`; return an answer for each.

        What they have waited for a processor meanwhile does not count, see `starved`.
        """
        # Two steps: the file of the second is read only for calls that are old by the clock.
        end = time.monotonic() - seconds
        old = [(number, call) for number, call in self._begun.items() if call.begun < end]
        late = [number for number, call in old if call.begun + _processor_wait(call.worker) - call.waited < end]
        workers = {number: self._begun.pop(number).worker for number in late}
        for worker in workers.values():
            # All are asked before any is waited for: several stacks take the time of one.
            worker.ask_for_stack()
        until = time.monotonic() + STACK_PATIENCE
        given_up: list[Answer[T]] = []
        for number, worker in workers.items():
            overdue = Overdue(worker.stack(until), unanswered_step(worker.pending_step))
            given_up.append(Answer(number, None, overdue, worker.take_printed()))
            worker.end(0.0)
        return given_up

    def refused(self) -> list[tuple[str, str]]:
        """Return nobody: all processes are alike."""
        return []

    def starved(self, call: int) -> float:
        """Return the seconds that the process at a call has spent waiting for a processor, where the system counts it.

        What shares a machine with others is late for them: who waits for an answer need not count that. 0.0 where it is
        not known, and for a call that is answered.
        """
        begun = self._begun.get(call)
        return 0.0 if begun is None else _processor_wait(begun.worker)

    def pulse(self, call: int) -> tuple[int, bool]:
        """Return how many answers renderers have given in the process at a call, and whether it compiles now.

        Both stay nothing with `fresh`, and for a call that is answered.
        """
        begun = self._begun.get(call)
        answers, compilations = (0, 0) if begun is None else begun.worker.pulse
        return answers, compilations > 0

    def _new(self) -> _Worker:
        # Calls and answers by one pipe, stacks by another: a stack may come in the middle of an answer.
        ours, theirs = multiprocessing.Pipe()
        stack_pipe, stack_end = multiprocessing.Pipe(duplex=False)
        process: BaseProcess | subprocess.Popen[bytes]
        printed: _Printed | None = None
        pulse, pending = multiprocessing.RawArray("q", 2), multiprocessing.RawArray("d", PENDING_SIZE)
        if self._fresh:
            pipes = [theirs.fileno(), stack_end.fileno()]
            command = [sys.executable, "-c", SERVE, *map(str, pipes), str(os.getpid())]
            process = subprocess.Popen(command, pass_fds=pipes)
            with contextlib.suppress(OSError):  # it has ended: that is seen at the first call
                ours.send((sys.path, pickle.dumps(self._function)))
        else:
            printed_pipe, print_end = os.pipe() if self._captures else (-1, -1)
            others = (ours.fileno(), stack_pipe.fileno(), *([printed_pipe] if self._captures else []))
            arguments = (theirs, stack_end, print_end, others, self._function, pulse, pending)
            process = multiprocessing.Process(target=_serve_forked, args=arguments)
            process.start()
            if self._captures:
                os.close(print_end)
                printed = _Printed(printed_pipe)
        # Only the child holds these ends now: when it dies, reading here ends.
        theirs.close()
        stack_end.close()
        return _Worker(process, ours, stack_pipe, pulse, pending, printed)


SERVE = "import sys; from hapticeval.workers import serve; serve(*map(int, sys.argv[1:]))"


def serve(pipe: int, stack_end: int, parent: int) -> None:
    """Answer calls that come by the pipe of that number, in an interpreter of its own, as long as the parent lives.

    The stack goes to the pipe `stack_end`.
    """
    _end_with_parent(parent)
    with contextlib.suppress(EOFError, OSError):
        connection = Connection(pipe)
        sys.path[:], function = connection.recv()
        _serve(connection, Connection(stack_end, readable=False), pickle.loads(function))


def _serve_forked(
    pipe: Connection,
    stack_end: Connection,
    print_end: int,
    others: tuple[int, ...],
    function: Callable[..., Any],
    pulse: Pulse,
    pending: PendingStep,
) -> None:
    """Answer calls in a copy of the parent, as long as that lives; print into the pipe `print_end`, unless it is -1."""
    _end_with_parent(os.getppid())
    share_pulse(pulse, pending)
    for other in others:
        os.close(other)  # else this process would keep its own pipe open
    if print_end >= 0:
        for descriptor in (1, 2):
            os.dup2(print_end, descriptor)
        os.close(print_end)
        sys.stdout = os.fdopen(1, "w", buffering=1, errors="backslashreplace", closefd=False)
        sys.stderr = os.fdopen(2, "w", buffering=1, errors="backslashreplace", closefd=False)
    _serve(pipe, stack_end, function)


def _end_with_parent(parent: int) -> None:
    """End this process when its parent is gone, also in the middle of a call that never ends.

    Compiled code that keeps Python's lock for ever keeps it from that.
    """

    def watch() -> None:
        # The system gives an orphan another parent.
        while os.getppid() == parent:
            time.sleep(PARENT_CHECK_PERIOD)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def _serve(pipe: Connection, stack_end: Connection, function: Callable[..., Any]) -> None:
    """Answer calls until the other end of the pipe is closed; it closes as well when the parent dies."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # A crash in compiled code leaves its stack there too.
    faulthandler.enable(file=stack_end.fileno(), all_threads=False)
    if STACK_SIGNAL is not None:
        faulthandler.register(STACK_SIGNAL, file=stack_end.fileno(), all_threads=False)
    _answering.extend((pipe, stack_end))
    try:
        while True:
            received = pipe.recv_bytes()
            result = _call_result(lambda: function(*pickle.loads(received[SERIAL_SIZE:])))  # noqa: B023 - called at once
            if pipe.closed:
                os._exit(0)  # a copy that came back from the call: the answer is its parent's to give
            _flush_printed()
            pipe.send_bytes(received[:SERIAL_SIZE] + _pickled_answer(*result))
    except (EOFError, BrokenPipeError, ConnectionResetError):
        return


def _flush_printed() -> None:
    """Send on what Python and C hold back of what they print into a pipe: else it would come with a later answer."""
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(Exception):  # a renderer may have put anything there
            stream.flush()
    with contextlib.suppress(Exception):  # where the system's C library is not that of this process
        ctypes.CDLL(None).fflush(None)


_answering: list[Connection] = []
"""The pipes by which this process answers: of a call, and of its stack."""


def _leave_pipes() -> None:
    """Give up the inherited pipes in a copy that a renderer makes of this process."""
    if not _answering:
        return
    faulthandler.disable()  # its crash must not be taken for this process's
    if STACK_SIGNAL is not None:
        faulthandler.unregister(STACK_SIGNAL)
    for pipe in _answering:
        pipe.close()
    _answering.clear()
    # Memory that it would share: what it does is no answer of this process's renderer.
    share_pulse([0, 0], [0.0] * PENDING_SIZE)


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_leave_pipes)


def _frames_of_call(text: bytes) -> tuple[list[Frame], bool]:
    """Return the frames that faulthandler wrote of a call, innermost first, and whether these are all of it."""
    frames = [
        (file, int(line), function)
        for file, line, function in re.findall(
            r'^  File "(.*)", line (\d+) in (.*)\n', text.decode(errors="replace"), re.MULTILINE
        )
    ]
    # From `_serve` on the frames are ours, and left out.
    ours = [place for place, (file, _, name) in enumerate(frames) if (file, name) == (__file__, _serve.__name__)]
    return frames[: ours[0] if ours else None], bool(ours)


def _call_result(call: Callable[[], T]) -> tuple[T | None, Exception | None]:
    """Make a call and return its value and None, or None and the error that it raised."""
    try:
        return call(), None
    except Exception as error:
        return None, error


def _pickled_answer(value: Any, error: Exception | None) -> bytes:
    """Return value and error pickled; what cannot be pickled becomes an error with its traceback as text."""
    try:
        if error is None:
            return pickle.dumps((value, None))
    except Exception as raised:
        error = raised
    # A traceback does not travel: it goes along as a note.
    text = "".join(traceback.format_exception(error))
    error.add_note(f"in another process:\n{text}")
    try:
        answer = pickle.dumps((None, error))
        # Some exceptions pickle and cannot be made again: tried here, not in the parent.
        pickle.loads(answer)
    except Exception:
        answer = pickle.dumps((None, RuntimeError(text)))
    return answer
