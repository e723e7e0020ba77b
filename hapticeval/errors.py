"""Errors that a user can act on: each says what happened, why, and what to do."""

from __future__ import annotations

import difflib
import math
import os
import re
import signal
import sysconfig
import traceback
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import PurePath

UNPRINTABLE = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u200e\u200f\u202a-\u202e\u2066-\u2069]")
"""Control characters beside tab and line feed, and those that turn the direction of writing."""


def printable(text: str) -> str:
    """Return a text with its control characters written out, as `\\x1b`: those of others could rewrite a terminal."""
    return UNPRINTABLE.sub(lambda match: match[0].encode("unicode_escape").decode(), text)


class HapticevalError(Exception):
    """Base of every error that is meant for the user's eyes.

    `what` happened, `why` it is wrong, `todo` says how to mend it; `exit_code` is what the command line returns.
    """

    exit_code = 2

    def __init__(self, what: str, *, why: str = "", todo: str = "") -> None:
        self.what = what
        self.why = why
        self.todo = todo
        super().__init__(what)

    def __str__(self) -> str:
        parts = [self.what]
        if self.why:
            parts.append(f"why: {self.why}")
        if self.todo:
            parts.append(f"what to do: {self.todo}")
        return "\n  ".join(parts)

    def __reduce__(self) -> tuple[object, ...]:
        # By the class and the fields, for the constructors of subclasses take other arguments.
        return _rebuild, (type(self), self.__dict__)


def _rebuild(cls: type[HapticevalError], state: dict[str, object]) -> HapticevalError:
    """Unpickle an error as it was: errors cross process borders in the runner."""
    error = cls.__new__(cls)
    error.__dict__.update(state)
    return error


class InputError(HapticevalError):
    """The input (a model, a trajectory, a suite, a recording) is not usable."""


class DomainError(HapticevalError):
    """A controller or a device was led out of where it is defined: a singular pose, a joint limit, a medial axis.

    It ends a simulated run at that tick; what was recorded up to there is kept and judged.
    """


class UnknownNameError(InputError):
    """A name that is not known, with the closest known ones."""

    def __init__(self, kind: str, name: str, known: Iterable[str], *, todo: str = "") -> None:
        names = sorted(known)
        # A likeness of one half: a wrong letter or two still match, and unlike words do not.
        close = difflib.get_close_matches(name, names, n=3, cutoff=0.5)
        suggestion = f"known: {', '.join(names)}" if names else "there is none: leave it out"
        if close:
            guess = f"did you mean {' or '.join(close)}?"
            # Less alike than three quarters, as square and star, is a poor guess: all are named beside it.
            is_sure = difflib.get_close_matches(name, close, cutoff=0.75)
            suggestion = guess if is_sure else f"{guess} {suggestion}"
        super().__init__(f"unknown {kind} '{name}'", why=f"no {kind} has that name", todo=todo or suggestion)


class RefusalError(InputError):
    """A renderer does not work in a scene: raised by its factory, or where the scene asks for what it does not support.

    `position` (m) is where on the model the reason was seen, where there is such a place.

    A refusal is not a fault: the verdicts of that renderer and case are not applicable, and say why.
    """

    position: tuple[float, ...] | None = None


class NothingSelectedError(HapticevalError):
    """A selection (-k, suites, renderers) that leaves nothing to run."""

    exit_code = 4


class RendererError(HapticevalError):
    """A renderer broke: it raised, answered in a wrong shape, or with a non-finite number.

    `tick` and `hip` (m) say where, and are None where it broke outside of a step.
    """

    exit_code = 3

    def __init__(
        self, what: str, *, tick: int | None = None, hip: Iterable[float] | None = None, why: str = "", todo: str = ""
    ) -> None:
        self.tick = tick
        self.hip = None if hip is None else tuple(float(x) for x in hip)
        place = ""
        if tick is not None and self.hip is not None:
            # Without both tick and HIP it broke outside of a step: nothing to add.
            place = f" at tick {tick} (counted from 0), HIP {in_mm(self.hip)}"
        super().__init__(what + place, why=why, todo=todo)

    def placed(self, tick: int, hip: Iterable[float]) -> RendererError:
        """Return the error with tick and HIP (N,), m: itself where it has them."""
        return (
            self
            if self.tick is not None
            else RendererError(self.what, tick=tick, hip=hip, why=self.why, todo=self.todo)
        )

    def after_lead_in(self, call: int, ticks: int) -> None:
        """Say which `call` of step() since the reset it was, of which so many `ticks` led the hand in before tick 0."""
        self.what += f"; call {call} of step() since the reset, {ticks} of which lead the hand in before tick 0"


class RunawayError(RendererError):
    """A simulated loop ran away: the renderer's force feeds energy into the device without end."""


def unreadable(what: str, error: OSError) -> InputError:
    """Return the error of a file ("x.toml", "the mesh file x.stl") that the system does not let be read."""
    return InputError(f"cannot read {what}", why=error.strerror or str(error), todo="check the path")


def unwritable(what: str, error: OSError) -> HapticevalError:
    """Return the error of a file or a folder that the system does not let be written."""
    # By its number: of HDF5 the text itself is a paragraph.
    why = os.strerror(error.errno) if error.errno else str(error)
    return HapticevalError(f"cannot write {what}", why=why, todo="name another place, or mend what bars this one")


def in_mm(point: Iterable[float]) -> str:
    """Return a point (m) as messages show it, for instance `(8.84, 64.7) mm`."""
    return f"{coordinates(1e3 * coordinate for coordinate in point)} mm"


def in_m(point: Iterable[float]) -> str:
    """Return a point (m) as messages about what someone wrote in metres show it, for instance `(0.05, 0) m`."""
    return f"{coordinates(point)} m"


def coordinates(point: Iterable[float]) -> str:
    """Return six digits of each coordinate; one that is only rounding beside the largest is 0."""
    numbers = [float(coordinate) for coordinate in point]
    largest = max((abs(number) for number in numbers if math.isfinite(number)), default=0.0)
    digits = (f"{0.0 if abs(number) <= 1e-14 * largest else number:.6g}" for number in numbers)
    return f"({', '.join(digits)})"


@contextmanager
def renderer_errors(call: str, *, tick: int | None = None, hip: Iterable[float] | None = None) -> Iterator[None]:
    """Turn whatever a renderer's `call` ("step()") raises into a `RendererError`: foreign code may raise anything.

    Errors that are meant for the user pass unchanged, and so does Ctrl-C: see `is_foreign`.
    """
    try:
        yield
    except HapticevalError:
        raise
    except BaseException as error:
        if not is_foreign(error):
            raise
        # The cause stays chained for a debugger; the message alone is for the user.
        raise blame_renderer(call, error, tick=tick, hip=hip) from error


def is_foreign(error: BaseException) -> bool:
    """Return whether foreign code raised an error, not the user: KeyboardInterrupt too where Ctrl-C is ignored."""
    return not isinstance(error, KeyboardInterrupt) or signal.getsignal(signal.SIGINT) is signal.SIG_IGN


def blame_renderer(
    call: str, error: BaseException, *, tick: int | None = None, hip: Iterable[float] | None = None
) -> RendererError:
    """Return the `RendererError` for what a renderer's `call` raised: see `renderer_errors`."""
    what = f"the renderer's {call} raised {describe_error(error)}"
    frames = traceback.extract_tb(error.__traceback__)
    why, todo = origin(error), ""
    # A TypeError with no frame of foreign code: the call itself did not fit the signature.
    if call in CALLS and isinstance(error, TypeError) and all(_is_ours(PurePath(frame.filename)) for frame in frames):
        why, todo = f"it is called as {CALLS[call]}", "let it take these arguments; see docs/write-a-renderer.md"
    if isinstance(error, MemoryError):
        todo = "see what it keeps from tick to tick: the memory of this machine ran out"
    return RendererError(what, tick=tick, hip=hip, why=why, todo=todo)


CALLS = {
    "factory": "factory(scene)",
    "place()": "place(rotation, translation)",
    "reset()": "reset(hip)",
    "step()": "step(hip, velocity, dt)",
}
"""How a renderer is called, by what its calls are named in messages."""


def kind_of(what: str) -> str:
    """Return the words of a message before its numbers, places and foreign texts: equal for errors of one kind."""
    return what.split(" at tick ")[0].split(": ")[0]


@contextmanager
def at(place: str) -> Iterator[None]:
    """Put the `place` (a file, a case in it) in front of what any `InputError` of the block says."""
    try:
        yield
    except InputError as error:
        # `args` as well, which `repr` shows.
        error.what = f"{place}: {error.what}"
        error.args = (error.what,)
        raise


def describe_error(error: BaseException) -> str:
    """Return the type and the text of an exception of foreign code, whose text may not be readable or printable."""
    try:
        # Surrogates, as of undecodable file names, could not be printed or written.
        # In one line, as all that stands before and after it.
        text = "; ".join(line.strip() for line in str(error).splitlines()).encode("utf-8", "backslashreplace").decode()
    except (Exception, SystemExit) as unreadable:
        text = f"(its text cannot be read: {type(unreadable).__name__})"
    return f"{type(error).__name__}: {text}" if text else type(error).__name__


def origin(error: BaseException, file: str | None = None) -> str:
    """Return where in foreign code an exception came from: the innermost frame in `file`, else of all."""
    frames = [frame for frame in traceback.extract_tb(error.__traceback__) if "importlib" not in frame.filename]
    # The innermost frame, if there is any: a slice instead of an index.
    for last in ([frame for frame in frames if frame.filename == file] or frames)[-1:]:
        return _describe_frame(last)
    return ""


def place_in_stack(stack: Sequence[tuple[str, int, str]]) -> str:
    """Return the place in foreign code at which a process was, from its `stack`, outermost frame first; "" without one.

    Foreign code begins where ours calls it. The place is its innermost frame in the same folder, not one of a library
    that it waits in. Where it has none, as in a C library that ours calls, the place is in ours.
    """
    # Frames of the standard library, such as sleep or a lock, say nothing of who called them.
    code = [frame for frame in stack if not _is_standard(PurePath(frame[0]))]
    # The outermost frame that is not ours; the first one where all are ours.
    foreign = next((at for at, (file, *_) in enumerate(code) if not _is_ours(PurePath(file))), 0)
    # From the innermost outwards, until one in the same folder as that.
    for file, line, name in reversed(code[foreign:]):
        if PurePath(file).is_relative_to(PurePath(code[foreign][0]).parent):
            return _describe_frame(traceback.FrameSummary(file, line, name))
    return ""


def _is_ours(file: PurePath) -> bool:
    return file.is_relative_to(PurePath(__file__).parent)


def _is_standard(file: PurePath) -> bool:
    """Return whether a file is of Python's standard library, or frozen; installed packages lie in a folder of it."""
    if file.name.startswith("<"):
        return True
    return file.is_relative_to(sysconfig.get_path("stdlib")) and not {"site-packages", "dist-packages"} & {*file.parts}


def _describe_frame(frame: traceback.FrameSummary) -> str:
    place = f"in {PurePath(frame.filename).name}, line {frame.lineno}, in {frame.name}"
    return f"{place}: {frame.line}" if frame.line else place
