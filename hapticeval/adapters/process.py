"""A renderer in a process of its own, `cmd:./mine`: one JSON object a line, asked on its stdin and answered on stdout.

Each message has an `id` and a `call`, and its answer has the same `id`. No wait is without end: a child that is late,
has died or answers nonsense is ended, and the error says which.
"""

from __future__ import annotations

import contextlib
import ctypes
import json
import os
import selectors
import shlex
import signal
import subprocess
import sys
import tempfile
import time
import weakref
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from typing import IO, Any, NoReturn, cast

import numpy as np

from hapticeval.adapters.outside import Outside
from hapticeval.errors import DomainError, InputError, RefusalError, RendererError, in_m
from hapticeval.geometry.pose import Pose
from hapticeval.renderer import RANGE_WORDS, Declaration, Response, Spring
from hapticeval.scene import MOVING, Scene, requirements
from hapticeval.types import Array
from hapticeval.workers import describe_exit

VERSION = 1
"""Version of the protocol."""

STARTING = ("hello", "scene")
"""Calls with which a process begins."""

START_PATIENCE, ANSWER_PATIENCE = 60.0, 20.0
"""Seconds that a child has for its hello, while a large program loads, and for another answer."""

HUNG_PATIENCE = 2.0
"""Seconds for an answer once a process of that command has hung, or twice its longest answer. *Chosen*."""

GRACE = 1.0
"""Seconds that a child has to end after bye."""

ANSWER_BYTES = 1 << 20
"""Bytes that an answer may have: what prints without end is not an answer."""

EXCERPT_LENGTH = 300
"""Characters of an odd answer that an error shows."""

STDERR_LENGTH = 1000
"""Bytes of what the child wrote to stderr that an error shows at the most: node says what is wrong 600 from the end."""


@dataclass
class Patience:
    """How long the processes of one command are waited for: less once one has hung, else every case would take minutes.

    `longest_answer` is the time (s) of the longest answer so far, of those to hello and scene apart.
    """

    has_hung: bool = False
    longest_answer: float = 0.0

    @property
    def seconds(self) -> float:
        """Seconds for an answer."""
        return min(ANSWER_PATIENCE, max(HUNG_PATIENCE, 2.0 * self.longest_answer)) if self.has_hung else ANSWER_PATIENCE


class Child:
    """A process that answers messages. It ends with the process that made it, where the system offers that."""

    def __init__(self, command: tuple[str, ...], patience: Patience) -> None:
        self.command = shlex.join(command)
        self._patience = patience
        self._errors: IO[bytes] = tempfile.TemporaryFile()  # noqa: SIM115 - lives as long as the child
        try:
            self._process = subprocess.Popen(
                command,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=self._errors,
                bufsize=0,
                start_new_session=True,  # Ctrl-C is the parent's, and what the child starts can be ended with it
                preexec_fn=_dies_with_parent(),
            )
        except OSError as error:
            self._errors.close()
            raise InputError(
                f"cannot start '{self.command}'",
                why=error.strerror or str(error),
                todo="give a program as in a shell: cmd:./mine, 'cmd:python3 mine.py'",
            ) from error
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._in, self._out = self._process.stdin.fileno(), self._process.stdout.fileno()
        # A child may fill its stdout before it has read all of a message: a blocking write would wait for ever.
        os.set_blocking(self._in, False)
        self._pending = b""
        self._id = 0
        self._failure: RendererError | None = None
        self._close = weakref.finalize(self, _end_child, self._process, self._in, self._errors)

    @property
    def has_failed(self) -> bool:
        """Whether it was ended for what it did, and answers no more."""
        return self._failure is not None

    def ask(self, call: str, patience: float, **entries: Any) -> dict[str, Any]:
        """Return the child's answer to a message. Raises `RendererError` where there is none that makes sense.

        Lines before the answer to hello that are not JSON are left out: programs greet.
        """
        if self._failure is not None:
            raise self._failure
        self._id += 1
        # NaN and Infinity are Python's, and no JSON: a number that is missing is null, see `_plain`.
        message = json.dumps({"id": self._id, "call": call, **entries}, allow_nan=False).encode() + b"\n"
        begun = time.monotonic()
        deadline = begun + patience
        while True:
            line = self._exchange(message, call, deadline, patience)
            # It is written by now: further turns only read on.
            message = b""
            try:
                answer = json.loads(line)
            except (ValueError, RecursionError):
                answer = None
            if isinstance(answer, dict) and answer.get("id") == self._id:
                break
            # Before its first answer a program may greet; what is JSON with another id is not a greeting.
            if call != "hello" or isinstance(answer, dict):
                excerpt = line[:EXCERPT_LENGTH].decode(errors="replace")
                self.fail(
                    f"answers '{call}' with something else: {excerpt}",
                    why=f"an answer is one line: a JSON object with the message's id, here {self._id}",
                    todo="print nothing else to stdout, and flush after each line; notes go to stderr",
                )
        if call not in STARTING:
            self._patience.longest_answer = max(self._patience.longest_answer, time.monotonic() - begun)
        if "error" in answer:
            self.fail(f"reports an error in '{call}': {_excerpt(answer['error'])}")
        return answer

    def _exchange(self, message: bytes, call: str, deadline: float, patience: float) -> bytes:
        """Write a message and read a line, both at once: a child may begin to answer before it has read all."""
        with selectors.DefaultSelector() as ready:
            ready.register(self._out, selectors.EVENT_READ)
            if message:
                ready.register(self._in, selectors.EVENT_WRITE)
            while b"\n" not in self._pending:
                seconds_left = deadline - time.monotonic()
                if seconds_left <= 0.0:
                    hung_before = self._patience.has_hung and call not in STARTING
                    less = "; it has less time since one hung before" * hung_before
                    self._patience.has_hung = True
                    self.fail(
                        f"gives no answer to '{call}' in {patience:.3g} s",
                        why=f"it hangs, is too slow, or keeps its answer in a buffer{less}",
                        todo="write a line for each message, and flush stdout after it",
                    )
                for key, _ in ready.select(seconds_left):
                    if key.fd == self._in:
                        message = message[self._write(message, call) :]
                        if not message:
                            ready.unregister(self._in)
                        continue
                    chunk = os.read(self._out, 1 << 16)
                    self._pending += chunk
                    # the end of its stdout
                    if not chunk:
                        self._died(call)
                    if len(self._pending) > ANSWER_BYTES:
                        self.fail(
                            f"prints more than {ANSWER_BYTES} bytes in answer to '{call}'",
                            todo="print one line for each message",
                        )
        # What follows the newline belongs to the next answer.
        line, _, self._pending = self._pending.partition(b"\n")
        return line

    def _write(self, message: bytes, call: str) -> int:
        """Write some of a message, and return how many bytes the pipe has taken."""
        try:
            # A part at a time: as much as the pipe takes.
            return os.write(self._in, message[: 1 << 16])
        # it has filled since select looked at it
        except BlockingIOError:
            return 0
        except OSError:
            self._died(call)

    def _died(self, call: str) -> NoReturn:
        """Raise `RendererError` for a child that has ended, or closed its stdout, without an answer."""
        with contextlib.suppress(subprocess.TimeoutExpired):
            # Its pipes close a moment before its exit code is known.
            self._process.wait(GRACE)
        code = self._process.poll()
        how = "closed its stdout" if code is None else f"ended: {describe_exit(code)}"
        todo = "let it read messages until 'bye' or the end of its stdin"
        if call == "hello" and code:
            todo = f"see in a shell whether it starts: {self.command}"
        self.fail(f"{how}, with '{call}' to answer", todo=todo)

    def fail(self, what: str, *, why: str = "", todo: str = "") -> NoReturn:
        """End the child and raise `RendererError`, with the end of what it wrote to stderr."""
        _kill_child(self._process)
        size = self._errors.seek(0, os.SEEK_END)
        self._errors.seek(max(size - STDERR_LENGTH, 0))
        stderr_end = self._errors.read().decode(errors="replace").strip()
        if size > STDERR_LENGTH:  # the first line is cut: it goes, unless it is the only one
            stderr_end = stderr_end.partition("\n")[2] or stderr_end
        self._close()
        why = "; ".join(part for part in (why, stderr_end and f"its stderr ends: {stderr_end}") if part)
        self._failure = RendererError(f"the process '{self.command}' {what}", why=why, todo=todo)
        raise self._failure


def _end_child(process: subprocess.Popen[bytes], stdin: int, errors: IO[bytes]) -> None:
    """End a child: by bye and the end of its stdin, and then at once."""
    # Bye and the end of stdin ask it to end; then it has GRACE.
    if process.poll() is None:
        with contextlib.suppress(OSError):
            os.write(stdin, b'{"id": 0, "call": "bye"}\n')
    for pipe in (process.stdin, process.stdout, errors):
        if pipe is not None:
            with contextlib.suppress(OSError):
                pipe.close()
    with contextlib.suppress(subprocess.TimeoutExpired):
        process.wait(GRACE)
    _kill_child(process)


def _kill_child(process: subprocess.Popen[bytes]) -> None:
    """End a child at once, with all that it has started."""
    with contextlib.suppress(OSError):
        # It leads a session, so that its number is also that of the group of all that it started.
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()


def _dies_with_parent() -> Callable[[], None] | None:
    """Return what a child calls to be killed when its parent is; None where the system has no such thing."""
    if not sys.platform.startswith("linux"):
        return None
    # Looked up before the fork: in between fork and exec nothing should be loaded.
    control = ctypes.CDLL(None).prctl

    def call() -> None:
        control(1, signal.SIGKILL)  # PR_SET_PDEATHSIG

    return call


def _plain(numbers: Array) -> list[Any]:
    """Return numbers of any shape, in their own unit, as JSON has them: null for what is not finite."""
    plain = numbers.astype(object)
    plain[~np.isfinite(numbers)] = None
    return list(plain.tolist())


def _excerpt(value: Any) -> str:
    return " ".join(str(value).split())[:EXCERPT_LENGTH]


@dataclass(frozen=True)
class Hello:
    """What a process says of itself before a scene."""

    supports: frozenset[str] = frozenset()
    max_error: float = 0.0
    spring: bool = False
    force_only: bool = False
    memoryless: bool = False
    smooth_only: bool = False
    name: str = ""


@dataclass(frozen=True)
class ProcessFactory:
    """Makes renderers that are processes, one each; it can be pickled for other processes."""

    command: tuple[str, ...]
    hello: Hello = field(repr=False)
    patience: Patience = field(default_factory=Patience, repr=False, compare=False)

    @property
    def summary(self) -> str:
        """In a line what it makes."""
        return self.hello.name or f"the process {shlex.join(self.command)}"

    @property
    def supports(self) -> frozenset[str]:
        """What the process has said."""
        return self.hello.supports

    def __call__(self, scene: Scene) -> ProcessRenderer:
        """Start a process for a scene."""
        return ProcessRenderer(self, scene)


def process(command: str) -> ProcessFactory:
    """Return the factory of renderers that a command starts. Raises `InputError` where it gives no proper hello."""
    try:
        words = tuple(shlex.split(command))
    except ValueError as error:
        raise InputError(f"'cmd:{command}' is not a command", why=str(error)) from error
    if os.name != "posix":
        raise InputError("renderers in processes need pipes that can be waited for", why=f"this system is {os.name}")
    return ProcessFactory(words, _hello_of(words))


@lru_cache(maxsize=32)
def _hello_of(command: tuple[str, ...]) -> Hello:
    """Start a command once to have its hello. Raises `InputError`."""
    try:
        return _say_hello(Child(command, Patience()))
    except RendererError as error:
        raise InputError(error.what, why=error.why, todo=error.todo or "see docs/outside-renderers.md") from error


def _say_hello(child: Child) -> Hello:
    """Return what a child answers to hello. Raises `RendererError` where that does not fit the protocol."""
    answer = child.ask("hello", START_PATIENCE, version=VERSION)
    if answer.get("version") != VERSION:
        child.fail(
            f"speaks version {_excerpt(answer.get('version'))} of the protocol",
            why=f"this version of hapticeval speaks {VERSION}",
            todo=f'answer hello with "version": {VERSION}',
        )
    supports = answer.get("supports", [])
    if not isinstance(supports, list) or not set(map(str, supports)) <= set(requirements()):
        child.fail(
            f"supports {_excerpt(supports)}", why=f'"supports" is a list of names, of {", ".join(requirements())}'
        )
    lengths = _read_lengths(child, answer, "max_error")
    name = _excerpt(answer.get("name", ""))
    flags = {flag: bool(answer.get(flag)) for flag in ("spring", "force_only", "memoryless", "smooth_only")}
    return Hello(frozenset(supports), lengths["max_error"], name=name, **flags)


def _read_lengths(child: Child, answer: Mapping[str, Any], *names: str) -> dict[str, float]:
    """Return lengths (m) of an answer by name, 0 where it has none. Raises `RendererError` for what is not a length."""
    lengths = {name: answer.get(name, 0.0) for name in names}
    for name, value in lengths.items():
        if isinstance(value, bool) or not isinstance(value, int | float) or not 0.0 <= value < float("inf"):
            child.fail(f"has {name} = {_excerpt(value)}", why="it is a length in metres: finite and not negative")
    return {name: float(value) for name, value in lengths.items()}


def _declaration(child: Child, hello: Hello, answer: Mapping[str, Any]) -> Declaration:
    """Return what the process promises in its hello and in its answer to a scene. Raises `RendererError`."""
    shares = answer.get("stiffness_range")
    promise = Declaration(
        spring=Spring.ERROR if hello.spring else None,
        force_only=hello.force_only,
        memoryless=hello.memoryless,
        smooth_only=hello.smooth_only,
        stiffness_range=shares if shares is None or not isinstance(shares, list) else tuple(shares),
        force_resolution=answer.get("force_resolution", 0.0),
    )
    if promise.faults:
        child.fail(
            f"has stiffness_range = {_excerpt(answer.get('stiffness_range'))} and force_resolution = "
            f"{_excerpt(answer.get('force_resolution', 0.0))}",
            why=f"the first is [least, largest] as shares of the scene's stiffness, {RANGE_WORDS}; the second is in "
            "newtons, finite and not negative",
        )
    return promise


class ProcessRenderer:
    """A renderer that is a process, asked over its stdin and stdout.

    `contact` is whether its last answer reported contact; None where it did not say.
    """

    def __init__(self, factory: ProcessFactory, scene: Scene) -> None:
        hello = factory.hello
        self._factory, self._outside = factory, Outside(scene, hello.max_error)
        self.contact: bool | None = None
        self._child, answer = self._start()
        lengths = _read_lengths(self._child, answer, "standoff", "resolution")
        self._margin = lengths["standoff"]
        # Attributes that a renderer has only where they hold: see `Outside.lengths`.
        self.__dict__.update(self._outside.lengths(**lengths))
        self.declares = _declaration(self._child, hello, answer)
        self.supports = hello.supports
        self._pose: Pose | None = None
        if MOVING in hello.supports:
            self.place = self._place

    def _start(self) -> tuple[Child, dict[str, Any]]:
        """Start a process, give it the scene, and return it with its answer to that."""
        scene, facets = self._outside.scene, self._outside.facets
        child = Child(self._factory.command, self._factory.patience)
        _say_hello(child)
        answer = child.ask(
            "scene",
            START_PATIENCE,
            dimension=scene.model.dimension,
            bilateral=scene.bilateral,
            **({} if scene.motion is None else {"moving": True}),
            vertices=facets.vertices.tolist(),
            cells=facets.cells.tolist(),
            **cast("dict[str, Any]", self._outside.numbers),
        )
        if "refuse" in answer:
            raise RefusalError(
                f"the process refuses the model '{scene.model.name}'",
                why=_excerpt(answer["refuse"]),
                todo="choose another case",
            )
        return child, answer

    def _place(self, rotation: Array, translation: Array) -> None:
        """Keep the pose of the body for the next message: see `WrappedRenderer.place`. It has `place` if it says so."""
        self._pose = Pose(rotation, translation)

    def reset(self, hip: Array) -> None:
        """Start a run with the hand at `hip` (N,), m, in another process where the last one was ended.

        Raises `DomainError` where the process refuses it.
        """
        hip = np.asarray(hip, dtype=np.float64)
        self.contact = None
        if self._child.has_failed:
            self._child, _ = self._start()
        tool = self._outside.tool(hip, self._margin, self._pose)
        self._check_refusal(
            self._child.ask(
                "reset", self._factory.patience.seconds, hip=_plain(hip), tool=_plain(tool), **self._placed()
            ),
            hip,
        )

    def step(self, hip: Array, velocity: Array, dt: float) -> Response:
        """One tick: `hip` (N,), m; `velocity` (N,), m/s; `dt`, s. Raises `DomainError` where the process refuses it."""
        hip = np.asarray(hip, dtype=np.float64)
        entries: dict[str, Any] = {"hip": _plain(hip), "velocity": _plain(np.asarray(velocity)), "dt": float(dt)}
        entries |= self._placed()
        answer = self._child.ask("step", self._factory.patience.seconds, **entries)
        self._check_refusal(answer, hip)
        self.contact = bool(answer["contact"]) if "contact" in answer else None
        return Response(*(self._numbers(answer, name, hip.shape) for name in ("ihip", "force")))

    def _placed(self) -> dict[str, Any]:
        """Return the entry of a message that has the pose of the body; none of a body at rest."""
        if self._pose is None:
            return {}
        rotation, translation = self._pose
        return {"place": {"rotation": rotation.tolist(), "translation": translation.tolist()}}

    def _check_refusal(self, answer: Mapping[str, Any], hip: Array) -> None:
        """Raise `DomainError` where an answer refuses the `hip` (N,), m."""
        if "refuse" in answer:
            raise DomainError(f"the process refuses the HIP {in_m(hip)}", why=_excerpt(answer["refuse"]))

    def _numbers(self, answer: Mapping[str, Any], name: str, shape: tuple[int, ...]) -> Array:
        """Return an entry of an answer as an array of the shape of the HIPs; null stands for NaN."""
        try:
            numbers = np.array(answer[name], dtype=np.float64)
        except KeyError:
            self._child.fail(f"answers without '{name}'", why=f"the answer has {', '.join(answer)}")
        except (TypeError, ValueError):
            self._child.fail(f"answers {name} = {_excerpt(answer[name])}", why="it is a list of numbers")
        if numbers.shape != shape:
            self._child.fail(f"answers {name} of shape {numbers.shape}", why=f"the HIP has {shape}")
        return numbers
