"""The workers of a dask scheduler as a crew that calls a function: calls travel in chunks of some seconds.

- A task costs dask some milliseconds, whatever it does. So calls are sent together, as many as take some seconds.
- A worker makes calls in a child process, as a run on one machine does: one that crashes costs that child only.
- dask sends a chunk whose worker is gone to others, and makes an answer anew that was lost with its worker. A chunk
  that has cost more workers than its `allowed-failures` comes back, and its calls are sent one by one, until the one
  that kills is found.
- A worker whose numbers might differ in the last digit gets nothing to do. Fingerprints tell: those that are alike
  offer a resource by its name, for which the calls ask.

Imported only where somebody names a scheduler.
"""

from __future__ import annotations

import logging
import math
import pickle
import queue
import signal
import threading
import time
import warnings
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import CancelledError
from hashlib import sha256
from typing import Any, Generic, NamedTuple, Self, TypeAlias, TypeVar
from uuid import uuid4

from distributed import Client, KilledWorker
from distributed.comm.core import CommClosedError
from distributed.core import Status

from hapticeval.errors import HapticevalError, InputError
from hapticeval.runner import fingerprint as fingerprints
from hapticeval.workers import TRIES, Answer, LostError, ProcessEnded, Workers

T = TypeVar("T")

CHUNK_SECONDS = 2.5
"""Seconds that a chunk should take: dask's milliseconds for it are a thousandth of that."""

CHUNK_LIMIT = 10.0
"""Seconds after which a worker begins no further call of a chunk, and gives back the rest."""

MOST_CALLS = 4000
"""Calls in a chunk at most, however quick they are."""

CHUNKS_AHEAD = 2
"""Chunks for each thread of a worker that are under way, so that it has the next when it ends one."""

TIMED_CALLS = 64
"""How many calls, the last ones, tell how long a call takes."""

FETCH_SECONDS = 5.0
"""Seconds for which the answers of one chunk are waited for at a time, where they are slow or lost."""

OVERDUE_LOOK_SECONDS = 0.5
"""Seconds after which a worker sees that a call has taken too long, at the latest."""

CONNECT_SECONDS = 10.0
"""Seconds in which scheduler and workers must answer when a run begins."""

WORKERS_LOOK_SECONDS = 2.0
"""Seconds between two questions to the scheduler which workers it has."""

NO_WORKER_SECONDS = 60.0
"""Seconds without any worker after which none is expected any more."""

CONNECTION_ERRORS = (CommClosedError, OSError, TimeoutError, CancelledError)
"""What dask raises in place of an answer where the scheduler or the worker is gone."""


_Future: TypeAlias = Any
"""A future of dask, whose types are not known."""

_CLIENT: Any = Client

_Call: TypeAlias = tuple[int, tuple[Any, ...]]
"""Number and arguments of a call."""


class _Chunk(NamedTuple):
    """Calls that travel together.

    With `alone` nothing else is under way. dask blames everything that a killed worker had: only what was alone is
    known to have killed it.
    """

    calls: list[_Call]
    alone: bool = False


class Cluster(Generic[T]):
    """The workers of the scheduler at an `address`, which call `function` with arguments that can be pickled.

    Workers must have the `files`, digests by path, and end a call that takes longer than `timeout` seconds.

    A context manager, see `workers.Crew`; entering it raises
    `InputError` where no scheduler answers, it has no workers, or none of them is like this machine.
    """

    def __init__(
        self,
        function: Callable[..., T],
        address: str,
        *,
        timeout: float = math.inf,
        files: Mapping[str, str] | None = None,
    ) -> None:
        self._function = pickle.dumps(function)
        self._address = address
        self._timeout = timeout
        self._files = dict(files or {})
        self._waiting: deque[_Call] = deque()
        self._suspects: deque[_Chunk] = deque()
        self._under_way: dict[_Future, _Chunk] = {}
        self._finished_futures: queue.SimpleQueue[_Future] = queue.SimpleQueue()
        self._call_seconds: deque[float] = deque(maxlen=TIMED_CALLS)
        self._alike_threads: dict[str, int] = {}  # threads by address
        self._unlike: dict[str, str] = {}
        self._refused: list[tuple[str, str]] = []
        self._busy = 0
        self._looked = 0.0
        self._empty_since: float | None = None
        self._name = f"hapticeval-{uuid4().hex[:12]}"
        self._sent = 0

    def __enter__(self) -> Self:
        logging.getLogger("distributed").setLevel(logging.CRITICAL)  # what becomes of a connection is seen here
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # other versions are looked for here
                self._client = _CLIENT(self._address, timeout=CONNECT_SECONDS, set_as_default=False)
        except (*CONNECTION_ERRORS, ValueError) as error:
            raise InputError(
                f"no dask scheduler answers at {self._address}",
                why=str(error) or type(error).__name__,
                todo="start one with `dask scheduler`, and give its address: --scheduler tcp://HOST:8786",
            ) from error
        try:
            # Workers are compared with this process. Those that are alike offer a resource named by the fingerprint,
            # and dask gives calls that ask for it to no other worker.
            self._own_fingerprint = fingerprints.fingerprint({})
            self._resource = (
                f"hapticeval-{sha256(repr(sorted(self._own_fingerprint.items())).encode()).hexdigest()[:16]}"
            )
            end = time.monotonic() + CONNECT_SECONDS
            # Workers may still be registering with the scheduler: look again until the time is over.
            while not self._alike_threads and time.monotonic() < end:
                self._look_for_workers()
                # All that are there are unlike this machine: waiting brings no better ones.
                if self._unlike and not self._alike_threads:
                    break
                time.sleep(0.0 if self._alike_threads else 0.1)
            if not self._alike_threads:
                raise self._no_worker_error()
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        running = self._client.status == "running"
        try:
            if running and self._under_way:
                self._client.cancel(list(self._under_way), force=True)
            self._under_way.clear()
            # Closing waits for the scheduler, which is not worth two seconds where it is gone.
            self._client.close(timeout=2.0 if running else 0.1)
        except CONNECTION_ERRORS:
            pass

    @property
    def busy(self) -> int:
        """How many calls are under way or wait for a worker."""
        return self._busy

    @property
    def free(self) -> int:
        """How many more calls may begin now, so that each worker has the next chunk when it ends one."""
        threads = sum(self._alike_threads.values())
        # free = (chunks ahead) x (threads) x (calls in a chunk) - (calls begun)
        return max(CHUNKS_AHEAD * max(threads, 1) * self._chunk_size - self._busy, 0)

    @property
    def _chunk_size(self) -> int:
        """How many calls make a chunk."""
        # One call at a time until it is known how long one takes.
        if not self._call_seconds:
            return 1
        mean = sum(self._call_seconds) / len(self._call_seconds)
        # n = (seconds of a chunk) / (mean seconds of a call), from 1 to MOST_CALLS
        return max(1, min(MOST_CALLS, int(CHUNK_SECONDS / max(mean, 1e-6))))

    def begin(self, call: int, *arguments: Any) -> None:
        """Have a worker call the function; it is sent with others when answers are waited for."""
        self._waiting.append((call, arguments))
        self._busy += 1

    def answers(self, timeout: float | None = None) -> list[Answer[T]]:
        """Wait for an answer, for at most `timeout` seconds if given, and return all that there are.

        Raises `LostError` where the scheduler is gone, or all workers are for longer than `NO_WORKER_SECONDS`.
        """
        end = None if timeout is None else time.monotonic() + timeout
        while True:
            answers: list[Answer[T]] = []
            try:
                # Workers come and go while a run goes on.
                if time.monotonic() - self._looked > WORKERS_LOOK_SECONDS:
                    self._look_for_workers()
                self._send()
                seconds_left = WORKERS_LOOK_SECONDS if end is None else max(end - time.monotonic(), 0.0)
                # Wait for one chunk, and take with it whatever else has ended meanwhile.
                ended_futures = [self._finished_futures.get(timeout=min(seconds_left, WORKERS_LOOK_SECONDS))]
                ended_futures += [self._finished_futures.get_nowait() for _ in range(self._finished_futures.qsize())]
                for future in ended_futures:
                    answers += self._collect_answers(future)
            except queue.Empty:
                pass
            except CONNECTION_ERRORS as error:
                raise self._lost_error(error) from error
            if self._client.status != "running":
                raise self._lost_error()
            if answers or not self._busy or (end is not None and time.monotonic() >= end):
                self._busy -= len(answers)
                return answers

    def give_up(self, seconds: float) -> list[Answer[T]]:
        """Give up nothing, whatever the `seconds`: each worker sees to that itself, with the `timeout` it was given."""
        del seconds
        return []

    def refused(self) -> list[tuple[str, str]]:
        """Return the address of each worker that gets nothing to do, and why: each is told of once."""
        refused_workers, self._refused = self._refused, []
        return refused_workers

    def _send(self) -> None:
        """Send the calls that wait, in chunks, or one that is suspected to kill its worker."""
        if not self._alike_threads:
            return
        chunks: list[_Chunk] = []
        if self._suspects or any(chunk.alone for chunk in self._under_way.values()):
            # A suspected call goes out when nothing else is under way: a worker that dies then was killed by it. New
            # calls wait until no suspect is left, so that they do not share the blame.
            if not self._under_way:
                chunks.append(self._suspects.popleft())
        else:
            while self._waiting:
                size = min(self._chunk_size, len(self._waiting))
                chunks.append(_Chunk([self._waiting.popleft() for _ in range(size)]))
        for chunk in chunks:
            self._sent += 1
            future = self._client.submit(
                make_calls,
                pickle.dumps((self._function, chunk.calls, self._timeout)),
                key=f"{self._name}-{self._sent}",
                # only workers that compute alike offer it
                resources={self._resource: 1},
                pure=False,
            )
            self._under_way[future] = chunk
            future.add_done_callback(self._finished_futures.put)

    def _collect_answers(self, future: _Future) -> list[Answer[T]]:
        """Return the answers of a chunk that has ended, and see to those of its calls that were not made."""
        chunk = self._under_way.pop(future)
        if future.status == "error":
            error = future.exception()
            # A call's own error travels in its answer: this one is the machinery's, and no other chunk would fare
            # better.
            if not isinstance(error, KilledWorker):
                raise HapticevalError(
                    "a worker of the cluster cannot make calls", why=f"{type(error).__name__}: {error}"
                ) from error
            return self._take_apart(chunk)
        try:
            answers, took = future.result(timeout=FETCH_SECONDS)
        except TimeoutError:  # they are slow to arrive, or lost with their worker and made anew by another
            self._under_way[future] = chunk
            self._finished_futures.put(future)
            return []
        except KilledWorker:
            return self._take_apart(chunk)
        except CancelledError:  # the scheduler is gone, or has forgotten them
            if self._client.status != "running":
                raise self._lost_error() from None
            answers, took = [], []
        self._call_seconds.extend(took)
        # A worker stops a chunk after CHUNK_LIMIT. The calls that were not made are sent next, in their order.
        self._waiting.extendleft(reversed(chunk.calls[len(answers) :]))
        return list(answers)

    def _take_apart(self, chunk: _Chunk) -> list[Answer[T]]:
        """Have the calls of a chunk that killed its workers made one by one, or give up the one call that does."""
        if chunk.alone:
            return [Answer(chunk.calls[0][0], None, ProcessEnded(-signal.SIGKILL))]
        self._suspects += [_Chunk([call], alone=True) for call in chunk.calls]
        return []

    def _look_for_workers(self) -> None:
        """Ask the scheduler for its workers, and new ones for their fingerprints. Raises `LostError` after too long."""
        self._looked = time.monotonic()
        workers = self._client.scheduler_info(n_workers=-1)["workers"]
        self._alike_threads = {address: count for address, count in self._alike_threads.items() if address in workers}
        # An address is asked once, and is alike or unlike from then on.
        new = [address for address in workers if address not in self._alike_threads and address not in self._unlike]
        if new:
            self._ask_fingerprints(new, {address: int(workers[address]["nthreads"]) for address in new})
        if self._alike_threads:
            self._empty_since = None
        elif self._empty_since is None:
            self._empty_since = self._looked
        elif self._looked - self._empty_since > NO_WORKER_SECONDS:
            raise LostError(
                f"no worker like this machine has been at the scheduler {self._address} for {NO_WORKER_SECONDS:g} s"
            )

    def _ask_fingerprints(self, addresses: Sequence[str], threads: Mapping[str, int]) -> None:
        """Sort workers into those like this machine and others; `threads` has how many each address offers."""
        replies = self._client.run(fingerprints.fingerprint, self._files, workers=list(addresses), on_error="return")
        for address, reply in replies.items():
            if isinstance(reply, (OSError, CommClosedError)):
                continue  # it has gone; if it comes again it is asked again
            if isinstance(reply, BaseException):
                # It has no hapticeval, or another one.
                differs = [f"{type(reply).__name__}: {reply}"]
            else:
                differs = fingerprints.differences(self._own_fingerprint, reply)
            if differs:
                self._unlike[address] = "; ".join(differs)
                self._refused.append((address, self._unlike[address]))
        alike = {address: threads[address] for address, reply in replies.items() if reply == self._own_fingerprint}
        if alike:
            # Threads count once their worker offers the resource: a call sent earlier would find no worker to go to.
            marked = self._client.run(mark, self._resource, workers=list(alike), on_error="return")
            self._alike_threads |= {address: alike[address] for address, done in marked.items() if done is True}

    def _no_worker_error(self) -> InputError:
        if not self._unlike:
            return InputError(
                f"the scheduler at {self._address} has no workers",
                todo=f"start some, as with `dask worker {self._address} --nthreads 1`",
            )
        reasons = "; ".join(f"{address} has {why}" for address, why in self._unlike.items())
        return InputError(
            f"no worker of {self._address} is like this machine",
            why=reasons,
            todo="install the same versions everywhere; for one processor set NUMBA_CPU_NAME and NUMBA_CPU_FEATURES",
        )

    def _lost_error(self, error: BaseException | None = None) -> LostError:
        why = "" if error is None else str(error) or type(error).__name__
        return LostError(f"the scheduler at {self._address} is gone", why=why)


async def mark(resource: str, dask_worker: Any) -> bool:
    """Have a worker offer a resource, once for each of its threads, and be given what waits for one that offers it."""
    await dask_worker.set_resources(**{resource: dask_worker.state.nthreads})
    # dask looks for what a worker could do when it comes, or goes on after a pause: not when it offers something new.
    dask_worker.status = Status.paused
    dask_worker.status = Status.running
    return True


_idle: dict[bytes, list[Workers[Any]]] = {}
_lock = threading.Lock()


def make_calls(packed: bytes) -> tuple[list[Answer[Any]], list[float]]:
    """Make the calls of a chunk in a child of this worker; return the answers of those it came to, and their seconds.

    The child is kept for later chunks; the first call in a new one, which loads what it needs, is not timed.
    """
    function, calls, timeout = pickle.loads(packed)
    # Threads of one worker come here at once. Each takes a child that is idle, or starts one.
    with _lock:
        idle_children = _idle.setdefault(function, [])
        is_warm = bool(idle_children)
        crew = idle_children.pop() if is_warm else Workers(pickle.loads(function), 1, tries=TRIES, fresh=True)
    answers: list[Answer[Any]] = []
    call_seconds = []
    begun = time.monotonic()
    for call, arguments in calls:
        before = time.monotonic()
        if answers and before - begun > CHUNK_LIMIT:
            break
        crew.begin(call, *arguments)
        # A call that takes longer than its timeout is given up, and that is its answer.
        while not (new_answers := [*crew.answers(OVERDUE_LOOK_SECONDS), *crew.give_up(timeout)]):
            pass
        answers += new_answers
        # The first call of a new child loads and compiles, and says nothing of the next.
        if is_warm:
            call_seconds.append(time.monotonic() - before)
        is_warm = True
    with _lock:
        _idle[function].append(crew)
    return answers, call_seconds
