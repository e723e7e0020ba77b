"""What happened in a run, beside its numbers."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np

from hapticeval.errors import InputError


class Event(NamedTuple):
    """Something that happened at `time` (s, on the recording's time base): a kind in one word, and a text."""

    time: float
    kind: str
    text: str = ""


def among(events: Iterable[Event], since: float, until: float) -> tuple[Event, ...]:
    """The events from `since` on and before `until`, s."""
    return tuple(event for event in events if since <= event.time < until)


def checked(given: Any) -> Event:
    """An event, or what is like one. Raises `InputError` unless it has a finite time, a kind and a text."""
    event = Event(*given)
    when = isinstance(event.time, int | float | np.floating | np.integer) and np.isfinite(event.time)
    texts = isinstance(event.kind, str) and isinstance(event.text, str) and "\0" not in event.kind + event.text
    if not (when and texts and event.kind):
        raise InputError(f"an event {tuple(event)}", why="it is a finite time (s), a kind and a text")
    return Event(float(event.time), event.kind, event.text)
