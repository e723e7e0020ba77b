"""The workers of a dask scheduler as a crew that calls a function, and which of them may.

- A worker makes a call in a child process, as a run on one machine does: one that crashes costs that child only.
- dask makes a call again whose worker is gone, or whose answer is lost with its worker. A call that has cost more
  workers than its `allowed-failures` is made once more with nothing beside it: another may have killed them.
- A worker whose numbers might differ in the last digit gets nothing to do. Those that are alike offer a resource by the
  name of what the last digit depends on, and calls ask for it.

Imported only where somebody names a scheduler.
"""

from __future__ import annotations

import hashlib
import importlib.util
import logging
import math
import os
import pickle
import platform
import queue
import signal
import threading
import time
import warnings
from collections import deque
from collections.abc import Callable, Mapping
from concurrent.futures import CancelledError
from functools import partial
from importlib import metadata
from pathlib import Path
from typing import Any, Generic, Self, TypeAlias, TypeVar
from uuid import uuid4

from distributed import Client, KilledWorker
from distributed.comm.core import CommClosedError
from distributed.core import Status

from hapticeval.errors import HapticevalError, InputError
from hapticeval.workers import TRIES, Answer, LostError, ProcessEnded, Workers

T = TypeVar("T")

COMPUTING_LIBRARIES = ("numpy", "scipy", "numba", "llvmlite", "shapely", "h5py")

CALLS_AHEAD = 4
"""Calls for each thread of a worker that are under way, so that it has the next when it ends one."""

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

_CLIENT: Any = Client

_Call: TypeAlias = tuple[int, tuple[Any, ...]]
"""Number and arguments of a call."""


class Cluster(Generic[T]):
    """The workers of the scheduler at an `address`, which call `function` with arguments that can be pickled.

    Workers must have the `files`, digests by path, and end a call that takes longer than `timeout` seconds.

    A context manager, see `workers.Crew`; entering it raises `InputError` where no scheduler answers, it has no
    workers, or none of them is like this machine.
    """

    def __init__(
        self,
        function: Callable[..., T],
        address: str,
        *,
        timeout: float = math.inf,
        files: Mapping[str, str] | None = None,
    ) -> None:
        self._function, self._timeout = pickle.dumps(function), timeout
        self._address, self._files = address, dict(files or {})
        self._under_way: dict[Any, _Call] = {}  # by dask's future
        self._suspects: deque[_Call] = deque()
        self._alone: _Call | None = None
        self._outcomes: queue.SimpleQueue[tuple[Any, list[Answer[T]] | BaseException]] = queue.SimpleQueue()
        self._threads: dict[str, int] = {}  # of workers that are alike, by address
        self._unlike: dict[str, str] = {}
        self._refused: list[tuple[str, str]] = []
        self._looked, self._seen = 0.0, time.monotonic()
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
            self._own = fingerprint({})
            self._resource = f"hapticeval-{_digest(repr(sorted(self._own.items())).encode())}"
            end = time.monotonic() + CONNECT_SECONDS
            # Workers may still be registering. Where all that are there are unlike, waiting brings no better ones.
            while not self._threads and not self._unlike and time.monotonic() < end:
                self._look_for_workers()
                time.sleep(0.0 if self._threads else 0.1)
            if not self._threads:
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
        return len(self._under_way) + len(self._suspects)

    @property
    def free(self) -> int:
        """How many more calls may begin now: none while one is suspected to kill its worker."""
        # Some also where all workers are gone for a while: who asks is done when nothing is under way.
        threads = max(sum(self._threads.values()), 1)
        return 0 if self._suspects or self._alone else max(CALLS_AHEAD * threads - self.busy, 0)

    def begin(self, call: int, *arguments: Any) -> None:
        """Have a worker call the function."""
        self._submit((call, arguments))

    def answers(self, timeout: float | None = None) -> list[Answer[T]]:
        """Wait for an answer, for at most `timeout` seconds if given, and return all that there are.

        Raises `LostError` where the scheduler is gone, or all workers are for longer than `NO_WORKER_SECONDS`.
        """
        end = math.inf if timeout is None else time.monotonic() + timeout
        while True:
            answers: list[Answer[T]] = []
            try:
                if time.monotonic() - self._looked > WORKERS_LOOK_SECONDS:
                    self._look_for_workers()
                seconds_left = min(max(end - time.monotonic(), 0.0), WORKERS_LOOK_SECONDS)
                # Wait for one, and take with it whatever else has ended meanwhile.
                outcomes = [self._outcomes.get(timeout=seconds_left)] if self._under_way else []
                outcomes += [self._outcomes.get_nowait() for _ in range(self._outcomes.qsize())]
                for future, outcome in outcomes:
                    answers += self._take(future, outcome)
            except queue.Empty:
                pass
            except CONNECTION_ERRORS as error:
                raise self._lost_error(error) from error
            if self._client.status != "running":
                raise self._lost_error()
            # dask blames everything that a killed worker had: only what was alone is known to have killed it.
            if self._suspects and not self._under_way:
                self._alone = self._suspects.popleft()
                self._submit(self._alone)
            if answers or not self.busy or time.monotonic() >= end:
                return answers

    def give_up(self, seconds: float) -> list[Answer[T]]:
        """Give up nothing, whatever the `seconds`: each worker sees to that itself, with the `timeout` it was given."""
        del seconds
        return []

    def refused(self) -> list[tuple[str, str]]:
        """Return the address of each worker that gets nothing to do, and why: each is told of once."""
        refused_workers, self._refused = self._refused, []
        return refused_workers

    def _submit(self, call: _Call) -> None:
        self._sent += 1
        packed = pickle.dumps((self._function, call, self._timeout))
        options = {"resources": {self._resource: 1}, "pure": False}  # only workers that compute alike offer it
        future = self._client.submit(make_call, packed, key=f"{self._name}-{self._sent}", **options)
        self._under_way[future] = call
        future.add_done_callback(self._fetch)

    def _fetch(self, future: Any) -> None:
        """Fetch what came of a call, in a thread of dask's: where it is lost with its worker that waits for another."""
        try:
            self._outcomes.put((future, future.result()))
        except BaseException as error:
            self._outcomes.put((future, error))

    def _take(self, future: Any, outcome: list[Answer[T]] | BaseException) -> list[Answer[T]]:
        """Return the answer of a call that has ended; have it made again where others are to blame that it has none."""
        call = self._under_way.pop(future)
        was_alone, self._alone = self._alone is call, None
        if not isinstance(outcome, BaseException):
            return outcome
        if isinstance(outcome, KilledWorker):
            if was_alone:
                return [Answer(call[0], None, ProcessEnded(-signal.SIGKILL))]
            self._suspects.append(call)
        elif isinstance(outcome, CONNECTION_ERRORS):  # the scheduler is gone, or has forgotten it
            if self._client.status != "running":
                raise self._lost_error(outcome) from outcome
            self._submit(call)
        else:  # a call's own error travels in its answer: this one is the machinery's, and no other would fare better
            why = f"{type(outcome).__name__}: {outcome}"
            raise HapticevalError("a worker of the cluster cannot make calls", why=why) from outcome
        return []

    def _look_for_workers(self) -> None:
        """Ask the scheduler for its workers, and new ones whether they are alike. Raises `LostError` after too long."""
        self._looked = time.monotonic()
        workers = self._client.scheduler_info(n_workers=-1)["workers"]
        self._threads = {address: count for address, count in self._threads.items() if address in workers}
        # An address is asked once, and is alike or unlike from then on.
        new = [address for address in workers if address not in self._threads and address not in self._unlike]
        offers = partial(offer, self._own, self._files, self._resource)
        for address, reply in self._client.run(offers, workers=new, on_error="return").items() if new else ():
            if isinstance(reply, (OSError, CommClosedError)):
                continue  # it has gone; if it comes again it is asked again
            # An error: it has no hapticeval, or another one.
            differs = f"{type(reply).__name__}: {reply}" if isinstance(reply, BaseException) else reply
            if differs:
                self._unlike[address] = differs
                self._refused.append((address, differs))
            else:
                self._threads[address] = int(workers[address]["nthreads"])
        if self._threads:
            self._seen = self._looked
        elif self._looked - self._seen > NO_WORKER_SECONDS:
            raise LostError(
                f"no worker like this machine has been at the scheduler {self._address} for {NO_WORKER_SECONDS:g} s"
            )

    def _no_worker_error(self) -> InputError:
        if not self._unlike:
            return InputError(
                f"the scheduler at {self._address} has no workers",
                todo=f"start some, as with `dask worker {self._address} --nthreads 1`",
            )
        return InputError(
            f"no worker of {self._address} is like this machine",
            why="; ".join(f"{address} has {why}" for address, why in self._unlike.items()),
            todo="install the same versions everywhere; for one processor set NUMBA_CPU_NAME and NUMBA_CPU_FEATURES",
        )

    def _lost_error(self, error: BaseException | None = None) -> LostError:
        why = "" if error is None else str(error) or type(error).__name__
        return LostError(f"the scheduler at {self._address} is gone", why=why)


def fingerprint(files: Mapping[str, str]) -> dict[str, str]:
    """Return what the last digit of a number computed here may depend on, by name: versions, source, processor.

    Of `files`, digests by path, those are named that are missing or another here.
    """
    import llvmlite.binding as llvm
    import numpy as np

    # These variables, where set, name the processor that numba compiles for: one for all of a mixed cluster.
    features = os.environ.get("NUMBA_CPU_FEATURES", llvm.get_host_cpu_features().flatten())
    simd: Any = np.show_config(mode="dicts")  # numpy chooses its loops by these when it is imported
    properties = {
        "python": platform.python_version(),
        "machine": platform.machine(),
        "libc": " ".join(platform.libc_ver()),
        **{name: metadata.version(name) for name in ("hapticeval", *COMPUTING_LIBRARIES)},
        "CPU": os.environ.get("NUMBA_CPU_NAME", llvm.get_host_cpu_name()),
        "CPU features": _digest(features.encode()),
        "CPU features of numpy": " ".join(simd["SIMD Extensions"]["found"]),
    }
    # A version does not tell an edited checkout: the source itself counts.
    code = b""
    for package in ("hapticeval", "hapticeval.renderers"):
        spec = importlib.util.find_spec(package)
        for folder in () if spec is None else spec.submodule_search_locations or ():
            for file in sorted(Path(folder).rglob("*.py")):
                code += str(file.relative_to(folder)).encode() + file.read_bytes()
    properties["code of hapticeval"] = _digest(code)
    for path, digest in files.items():
        file = Path(path)
        local_digest = hashlib.sha256(file.read_bytes()).hexdigest() if file.is_file() else ""
        # Files that are the same leave no entry, so that alike machines have equal fingerprints.
        if local_digest != digest:
            properties[f"the file {path}"] = "another" if local_digest else "missing"
    return properties


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()[:16]


async def offer(ours: Mapping[str, str], files: Mapping[str, str], resource: str, dask_worker: Any) -> str:
    """Have a worker that computes alike offer a `resource`, once a thread; return else in words how it differs.

    "numpy 2.1.0 in place of 2.4.6" is such a difference.
    """
    theirs = fingerprint(files)
    if theirs == ours:
        await dask_worker.set_resources(**{resource: dask_worker.state.nthreads})
        # dask looks for what a worker could do when it comes, or goes on after a pause: not when it offers a new thing.
        dask_worker.status = Status.paused
        dask_worker.status = Status.running
    return "; ".join(
        f"{name} {theirs.get(name, 'none')}" + (f" in place of {ours[name]}" if name in ours else "")
        for name in dict.fromkeys((*ours, *theirs))
        if ours.get(name) != theirs.get(name)
    )


_idle: dict[bytes, list[Workers[Any]]] = {}
_lock = threading.Lock()


def make_call(packed: bytes) -> list[Answer[Any]]:
    """Make a call in a child of this worker, which is kept for later ones; return its answer."""
    function, (call, arguments), timeout = pickle.loads(packed)
    # Threads of one worker come here at once. Each takes a child that is idle, or starts one.
    with _lock:
        children = _idle.setdefault(function, [])
        crew = children.pop() if children else Workers(pickle.loads(function), 1, tries=TRIES, fresh=True)
    crew.begin(call, *arguments)
    # A call that takes longer than its timeout is given up, and that is its answer.
    while not (answers := [*crew.answers(OVERDUE_LOOK_SECONDS), *crew.give_up(timeout)]):
        pass
    with _lock:
        _idle[function].append(crew)
    return answers
