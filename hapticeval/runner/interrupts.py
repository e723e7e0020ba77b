"""Ctrl-C while jobs run: a number to look at when there is time, in place of an exception anywhere."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType


class Interrupts:
    """Counts Ctrl-C within a `with` block, so that none falls into the middle of a save, an event or another one.

    It counts only where Ctrl-C would have raised `KeyboardInterrupt`: in the main thread, and where nobody else has
    defined what it means. Inside the block of another one, `with` gives that one.

    Afterwards Ctrl-C means what it did before. With `to_the_end` it stays ignored, for a command after which the
    process ends: an impatient user must not end it in a traceback.
    """

    _outermost: Interrupts | None = None

    def __init__(self, *, to_the_end: bool = False) -> None:
        self.count = 0
        self._to_the_end = to_the_end
        self._ours = False
        self._raises = False

    def __enter__(self) -> Interrupts:
        if Interrupts._outermost is not None:
            return Interrupts._outermost
        # Python runs signal handlers in the main thread alone, and lets no other thread set one.
        in_main = threading.current_thread() is threading.main_thread()
        self._ours = in_main and signal.getsignal(signal.SIGINT) is signal.default_int_handler
        if self._ours:
            Interrupts._outermost = self
            signal.signal(signal.SIGINT, self._counted)
        return self

    def __exit__(self, *_: object) -> None:
        if self._ours:
            signal.signal(signal.SIGINT, signal.SIG_IGN if self._to_the_end else signal.default_int_handler)
            Interrupts._outermost = None

    @contextmanager
    def raised(self) -> Iterator[None]:
        """Raise `KeyboardInterrupt` as well, inside this block."""
        self._raises = True
        try:
            yield
        finally:
            self._raises = False

    def _counted(self, _number: int, _frame: FrameType | None) -> None:
        self.count += 1
        # A job in this very process never looks at the count.
        if self._raises:
            raise KeyboardInterrupt
