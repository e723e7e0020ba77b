"""Ctrl-C while jobs run: a number to look at when there is time, in place of an exception anywhere."""

from __future__ import annotations

import signal
import threading
from types import FrameType, TracebackType


class Interrupts:
    """Counts interrupts from `with` on, so that none falls into the middle of a save, an event or another interrupt.

    Only where Ctrl-C would have raised `KeyboardInterrupt`: not in another thread, which gets none, and not where
    somebody else has said what it means.
    """

    def __init__(self) -> None:
        self.count = 0
        self._ours = False

    def __enter__(self) -> Interrupts:
        in_main = threading.current_thread() is threading.main_thread()
        self._ours = in_main and signal.getsignal(signal.SIGINT) is signal.default_int_handler
        if self._ours:
            signal.signal(signal.SIGINT, self._counted)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._ours:
            signal.signal(signal.SIGINT, signal.default_int_handler)

    def _counted(self, _number: int, _frame: FrameType | None) -> None:
        self.count += 1
