"""A first mapping for a file, from the names of its columns: what is unknown says `?`, which no conversion accepts."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from hapticeval.errors import HapticevalError
from hapticeval.recordings.channels import CHANNELS
from hapticeval.recordings.formats import Table
from hapticeval.recordings.importing.mapping import UNKNOWN
from hapticeval.recordings.importing.units import parse_unit

CLOCK = re.compile(r"(t|time|zeit|timestamp|stamp|sec|seconds|clock|received|tick|tout)", re.IGNORECASE)
PART = re.compile(r"(?P<stem>.*?)[._ \[]?(?P<part>[xyz]|\d+)\]?$", re.IGNORECASE)
BRACKETS = re.compile(r"\s*[\[(][^\])]*[A-Za-z°][^\])]*[\])]\s*$")
"""A unit that a header states after the name."""

STATED = re.compile(r"[\[(]([^\])]+)[\])]\s*$")
"""A unit that a label ends with."""

RULES: tuple[tuple[str, str], ...] = (
    ("ihip", r"ihip|proxy|god.?object|virtual.?tool"),
    ("operator_force", r"operator.?force|hand.?force|f_?h\b"),
    ("joint_torque", r"torque|tau|effort"),
    ("joint_velocity", r"joint.*vel|qd|omega"),
    ("joint_position", r"joint.*pos|theta|angle|encoder|\bq\b"),
    ("velocity", r"vel|speed|\bv\b"),
    ("force", r"force|wrench|\bf\b"),
    ("hip", r"hip|pos|\bp\b|^$|\bx\b|endeff|tool|stylus"),
)
"""Words in names and labels, and the channel that they may mean; the first that fits."""

DIRECTED = {"force", "operator_force", "measured_force", "joint_torque"}
"""Channels whose sign depends on who pushes whom, which no name tells."""


@dataclass
class Group:
    """Columns that may be the components of one channel."""

    columns: list[str] = field(default_factory=list)
    stem: str = ""


def propose(table: Table, *, file: str = "FILE") -> str:
    """A mapping as TOML text, with a remark on all that the file does not say.

    Units stand in it where the file states them. A position's sign is 1, which makes the file's axes the frame; the
    sign of a force is `?`. A file that hapticeval wrote says everything, and its proposal can be used as it is.
    """
    ours = bool(table.attributes.get("hapticeval"))
    clock = clocks(table)[0] if clocks(table) else None
    lines = [
        f'# Proposed for {file} ({table.format}). Replace each "?"; lines after # are remarks.',
        f"# Channels: {', '.join(CHANNELS)}.",
        '# Any other name says what it is: becomes = "N", meaning = "force of the wall", frame = "world" or "none".',
        f"title = {json.dumps(file)}",
        f"# Its format is code of yours, which no mapping names: give --format {table.format} beside the mapping."
        if ":" in table.format
        else f"format = {json.dumps(table.format)}",
        "",
        "[time]",
        *_time(table, clock),
    ]
    rows = table.rows(clock) if clock else max(table.rows(name) for name in table.columns)
    used = {clock}
    for channel, group in _channels(table, rows, clock):
        used |= set(group.columns)
        lines += ["", *_channel(table, channel, group, ours=ours)]
    valid = next((name for name in table.columns if ours and name.rpartition(".")[2] == "valid"), None)
    if valid is not None:
        used.add(valid)
        lines += ["", "[gaps]", f"column = {json.dumps(valid)}", "where = 0"]
    left = [name for name in table.columns if name not in used]
    if left:
        lines += ["", "# Columns that no channel is proposed for:"]
        lines += [f"#   {json.dumps(name)}: {_remark(table, name)}" for name in left]
    lines += ["", "[meta]", '# device = "", who = "", when = "2025-01-31T14:05:00+01:00"', ""]
    return "\n".join(lines)


def clocks(table: Table) -> list[str]:
    """The columns that may be a clock, by name and because they increase; the one with most companions first."""
    found = []
    for name, values in table.columns.items():
        leaf = re.split(r"[./]", BRACKETS.sub("", name))[-1].strip()
        steps = np.diff(np.asarray(values))
        if CLOCK.fullmatch(leaf) and steps.size and float(np.mean(steps > 0)) > 0.9:
            found.append(name)
    sizes = [np.size(values) for values in table.columns.values()]
    return sorted(found, key=lambda name: -sizes.count(table.rows(name)))


def _time(table: Table, clock: str | None) -> list[str]:
    if clock is None:
        return ["rate = 0  # Hz: the file has no column that looks like a clock; or give column and unit"]
    lines = [f"column = {json.dumps(clock)}  # {_remark(table, clock)}"]
    others = [name for name in clocks(table)[1:] if table.rows(name) == table.rows(clock)]
    if others:
        lines.append(f"# also increasing: {', '.join(others[:6])}")
    unit = table.units.get(clock, "?")
    if clock == "tick" and unit == "?":
        lines += ['unit = "ticks"', 'scale = "?"  # "0.001 s/tick" at 1000 Hz, if that was the scheduler\'s rate']
    else:
        lines.append(f"unit = {json.dumps(unit)}")
    return [*lines, 'start = "zero"']


def _channels(table: Table, rows: int, clock: str | None) -> Iterator[tuple[str, Group]]:
    """Channels with the first group of columns that its words fit."""
    groups: dict[str, Group] = {}
    found = {clock, *clocks(table)}
    for name in table.columns:
        if name in found or table.rows(name) != rows or table.topics.get(name) != table.topics.get(clock or ""):
            continue
        plain = BRACKETS.sub("", name).removesuffix(f"/{table.units.get(name)}")
        part = PART.fullmatch(plain)
        stem = part["stem"] if part else plain
        groups.setdefault(stem, Group(stem=stem)).columns.append(name)
    taken = set()
    for group in groups.values():
        words = f"{re.split(r'[./]', group.stem)[-1]} {' '.join(table.notes.get(name, '') for name in group.columns)}"
        own = group.stem.rpartition(".")[2]
        if own in CHANNELS:
            channel = own
        else:
            words = words.strip().lower() if group.stem else ""
            channel = next((name for name, rule in RULES if re.search(rule, words)), "")
        width = len(group.columns)
        if channel and channel not in taken and width <= 3:
            taken.add(channel)
            yield channel, group


def _channel(table: Table, channel: str, group: Group, *, ours: bool) -> list[str]:
    units = {_unit(table, name) for name in group.columns}
    signed = ours or channel not in DIRECTED
    lines = [f"[channels.{channel}]  # {CHANNELS[channel].meaning} ({CHANNELS[channel].unit})"]
    lines += [f"#   {json.dumps(name)}: {_remark(table, name)}" for name in group.columns]
    lines.append(f"columns = {json.dumps(group.columns, ensure_ascii=False)}")
    lines.append(f"unit = {json.dumps(units.pop() if len(units) == 1 else '?', ensure_ascii=False)}")
    if signed:
        return [*lines, "sign = 1" if ours else "sign = 1  # the axes of the file are taken for those of the model"]
    return [*lines, 'sign = "?"  # 1 or -1']


def _unit(table: Table, name: str) -> str:
    """What the file states, or the label of a column ends with in brackets."""
    found = STATED.search(table.notes.get(name, ""))
    unit = table.units.get(name) or (found[1].strip() if found else UNKNOWN)
    try:
        parse_unit(unit)
    except HapticevalError:
        return table.units.get(name, UNKNOWN)
    return unit


def _remark(table: Table, name: str) -> str:
    """Rows, range and the file's own words about a column."""
    values = table[name]
    finite = values[np.isfinite(values)]
    span = f"{finite.min():.6g} to {finite.max():.6g}" if finite.size else "no number"
    note = f"; {table.notes[name]}" if name in table.notes else ""
    return " ".join(f"{values.size} rows, {span}{note}".split())
