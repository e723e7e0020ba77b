"""A first mapping of a foreign file: which columns may be which channel, each with the reason, and what is not known.

Columns are put together to vectors, as `pos.x`, `pos.y` and `pos.z`, and each vector is scored as a whole for each
channel: by the words of its name, of its topic and of its label, by its unit, by its number of components and how they
are called, and by whether it moves at all. The best pairs are proposed; what has too few points for any channel, or is
what a device never logs as a motion (a sequence number, a level, a quaternion), is listed and proposed for none.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from hapticeval.documents import toml_text
from hapticeval.errors import HapticevalError
from hapticeval.recordings.channels import CHANNELS
from hapticeval.recordings.formats import Table
from hapticeval.recordings.importing.mapping import NOT_STATED, WIRED_CHANNELS
from hapticeval.recordings.importing.units import parse_unit

CLOCK_NAME = re.compile(
    r"t|zeit|sec|seconds|received|tick|tout|x_value|(\w*_)?(time|timestamp|stamp|clock|secs?\+\w+)", re.IGNORECASE
)
COMPONENT_NAME = re.compile(r"(?P<stem>.*?)[._/ \[]?(?P<part>[wxyz]|\d+)\]?$", re.IGNORECASE)
HEADER_UNIT = re.compile(r"\s*[\[(][^\])]*[A-Za-z°][^\])]*[\])]\s*$")
"""A unit that a header states after the name."""

SUFFIX_UNIT = re.compile(r"_(mm|cm|um|µm|ms|us|µs|ns|rad|mrad|deg|counts|N|mN|Nm|mNm|Nmm|V)$")
"""A unit that a name ends with, as in `x_mm`. Not m, s and g, which mean master, slave and gripper just as well."""

SUFFIX_SECONDS = re.compile(r"_(s)$")
"""The unit that the name of a clock may end with beside those."""

LABEL_UNIT = re.compile(r"[\[(]([^\])]+)[\])]\s*$")
"""A unit that a label ends with."""

RISING_SHARE = 0.9
"""Share of its steps in which a clock goes forward."""

EVEN_STEP = 0.5
"""Share of its median step by which each step of a column may differ from it that is a clock by its numbers alone."""

UNIX_UNITS = {"s": 1e9, "ms": 1e12, "us": 1e15, "ns": 1e18}
"""What a time since 1970 is larger than in each unit, and less than three times as large, from 2001 to 2065."""

WORDS: Mapping[str, frozenset[str]] = {
    channel: frozenset(words.split())
    for channel, words in {
        "ihip": "ihip proxy godobject virtualtool",
        "operator_force": "operatorforce handforce forcehand fh",
        "raw": "enc encoder count tick raw",
        "command": "command cmd u pwm voltage dac",
        "joint_torque": "torque tau effort drehmoment",
        "joint_velocity": "jointvelocity jointvel jointspeed qd qdot dq omega velocity",
        "joint_position": "jointposition jointpos jointangle joint theta angle winkel q position encoder enc",
        "velocity": "velocity vel speed geschwindigkeit v",
        "force": "force wrench kraft f",
        "hip": "hip position pos point weg p endeff endeffector effector tool stylus tip ee eef tcp hand pose",
    }.items()
}
"""The words that name each channel; two that follow each other are one as well, as in `god_object`."""

OTHER_WORDS = frozenset(
    re.findall(
        r"\w+",
        """seq sequence level id index status flag button line column covariance orientation quaternion quat rotation
        euler rpy error residual temperature battery rosout diagnostic acceleration acc accel gyro""",
    )
)
"""Words of what is none of these channels."""

DOUBTFUL_WORDS = frozenset(
    re.findall(r"\w+", "desired target goal reference ref setpoint camera object obstacle base marker cmd command")
)
"""Words of what is like the channel and somebody else's."""

DIRECTED_CHANNELS = {"force", "operator_force", "measured_force", "joint_torque"}
"""Channels whose sign depends on who pushes whom, which no name states."""

LEAST_POINTS = 2.0
"""Points of a proposal: one word in the name of a vector itself, or one in its topic and several components."""

MOST_COMPONENTS = 3
"""More columns are not a vector of the world, nor joints of a device that is known here."""


# A guess from numbers whose differences overflow fits nothing, and is not made.
@np.errstate(over="ignore", invalid="ignore")
def propose(table: Table, *, file: str = "FILE", trial: str | None = None) -> str:
    """Return a mapping as TOML text, with a remark on all that the file does not state.

    Units stand in it where the file or the name of a column states them. A position's sign is 1, which makes the
    file's axes the frame; the sign of a force is `?`. A file that hapticeval wrote states everything, and its proposal
    can be used as it is. The table is one `trial` of the file where that is named.
    """
    ours = bool(table.attributes.get("hapticeval"))
    clock_names = clocks(table)
    clock = clock_names[0] if clock_names else None
    lines = [
        f'# Proposed for {file} ({table.format}). Replace each "?"; lines after # are remarks.',
        f"# Channels: {', '.join(CHANNELS)}; of a robot's own numbers: {', '.join(WIRED_CHANNELS)}, with a [device].",
        '# Any other name is described: becomes = "N", meaning = "force of the wall", frame = "world" or "none".',
        f"title = {toml_text(file)}",
        f"# Its format is code of yours, which no mapping names: give --format {table.format} beside the mapping."
        if ":" in table.format
        else f"format = {toml_text(table.format)}",
        *([] if trial is None else [f"trial = {toml_text(trial)}"]),
        "",
        "[time]",
        *_time(table, clock_names),
    ]
    # What no proposal uses is listed at the end, so that nothing of the file goes unseen.
    used = {clock}
    proposals = _proposals(table, clock_names)
    for channel, proposal in proposals.items():
        used |= {*proposal.columns, proposal.own_clock}
        lines += ["", *_channel(table, channel, proposal, ours=ours)]
    if WIRED_CHANNELS.keys() & proposals.keys():
        lines += ["", *_device(max(len(proposals[name].columns) for name in WIRED_CHANNELS.keys() & proposals.keys()))]
    elif not proposals.keys() & {"hip", "joint_position"}:
        lines += ["", "# No column is named like the hand's position. Take the # off, and name its columns, x first:"]
        lines += [
            f"# [channels.hip]  # {CHANNELS['hip'].meaning} (m)",
            '# columns = ["?", "?"]',
            '# unit = "?"',
            "# sign = 1",
        ]
    valid = next((name for name in table.columns if ours and name.rpartition(".")[2] == "valid"), None)
    if valid is not None:
        used.add(valid)
        lines += ["", "[gaps]", f"column = {toml_text(valid)}", "where = 0"]
    left = [name for name in table.columns if name not in used]
    if left:
        lines += ["", "# Columns that no channel is proposed for:"]
        lines += [f"#   {toml_text(name)}: {_remark(table, name)}" for name in left]
    lines += ["", "[meta]", '# device = "", who = "", when = "2025-01-31T14:05:00+01:00"', ""]
    return "\n".join(lines)


def clocks(table: Table) -> list[str]:
    """Return the columns that may be a clock; the one with most companions first.

    By name and because they increase; where no name is a clock's, those that rise by an even step.
    """
    rising: list[str] = []
    now_and_then: list[str] = []
    even: list[str] = []
    for name, values in table.columns.items():
        steps = np.diff(np.asarray(values))
        # Nine in ten steps go forward: a clock that stands still or jumps now and then is still the clock.
        if CLOCK_NAME.fullmatch(_leaf(name.removesuffix(f"/{table.units.get(name)}"))) and np.any(steps > 0):
            if np.mean(steps > 0) > RISING_SHARE:
                rising.append(name)
            elif np.mean(steps >= 0) > RISING_SHARE:
                now_and_then.append(name)
        elif steps.size > 1 and np.all(np.abs(steps - np.median(steps)) < EVEN_STEP * np.median(steps)):
            even.append(name)
    # Of those without a name of their own, one that has the word comes first, and a bare count of rows last.
    even.sort(key=lambda name: (not {"time", "zeit", "timestamp"} & _words(name), table[name].dtype.kind == "i"))
    # The more columns have as many rows, the more signals were taken by that clock.
    sizes = [np.size(values) for values in table.columns.values()]
    return sorted(rising or now_and_then or even[:1], key=lambda name: -sizes.count(table.rows(name)))


def _time(table: Table, clock_names: list[str]) -> list[str]:
    """Return the lines of `[time]`: the clock that most columns share, and what a person has to add."""
    if not clock_names:
        return ["rate = 0  # Hz: the file has no column that looks like a clock; or give column and unit"]
    clock, *others = clock_names
    lines = [f"column = {toml_text(clock)}  # {_remark(table, clock)}"]
    if not CLOCK_NAME.fullmatch(_leaf(clock)) and not {"time", "stamp", "timestamp"} & _words(clock):
        lines.append("# no name says that it is the clock: it rises by an even step; or give rate = 1000 (Hz) alone")
    others = [name for name in others if table.rows(name) == table.rows(clock)]
    if others:
        lines.append(f"# also increasing: {', '.join(others[:6])}")
    seconds = SUFFIX_SECONDS.search(clock)
    unit = table.units.get(clock) or (seconds[1] if seconds else _unit(table, clock))
    first = float(np.nanmin(table[clock])) if table.rows(clock) else 0.0
    unix = next((name for name, after_2001 in UNIX_UNITS.items() if after_2001 < first < 3.0 * after_2001), None)
    # OpenHaptics counts the scheduler's ticks, whose rate is not in the file.
    if clock == "tick" and unit == NOT_STATED:
        lines += ['unit = "ticks"', 'scale = "?"  # "0.001 s/tick" at 1000 Hz, if that was the scheduler\'s rate']
    elif unit == NOT_STATED and unix is not None:
        day = np.datetime64(int(first / UNIX_UNITS[unix] * 1e9), "s")
        lines.append(f"unit = {toml_text(unix)}  # as a time since 1970 it begins at {day}")
    else:
        lines.append(f"unit = {toml_text(unit)}")
    return [*lines, 'start = "zero"']


@dataclass(frozen=True)
class Vector:
    """Columns that belong together, by how they are called: `stem` and `parts`, on a clock of their own or None."""

    stem: str
    parts: tuple[str, ...]
    columns: tuple[str, ...]
    own_clock: str | None


@dataclass(frozen=True)
class Proposal:
    """The columns of a channel, with the points that they have for it and the reasons for these, in words."""

    columns: tuple[str, ...]
    own_clock: str | None
    points: float
    reasons: tuple[str, ...] = ()


def _proposals(table: Table, clock_names: list[str]) -> dict[str, Proposal]:
    """Return the best vector for each channel, in the order of the file, those with a clock of their own last."""
    pairs = [
        (proposal.points, channel, proposal)
        for vector in _vectors(table, clock_names)
        for channel in (*CHANNELS, *WIRED_CHANNELS)
        if (proposal := _scored(table, vector, channel)) is not None
    ]
    proposals: dict[str, Proposal] = {}
    used_columns: set[str] = set()
    # The best pair first: then neither its channel nor its columns are free. Equal ones stay in the file's order.
    for _, channel, proposal in sorted(pairs, key=lambda pair: -pair[0]):
        if channel not in proposals and used_columns.isdisjoint(proposal.columns):
            # Joints go by names of their own as well as by numbers: enc_shoulder, enc_elbow.
            alike = [
                other
                for _, name, other in pairs
                if channel in WIRED_CHANNELS and name == channel and len(proposal.columns) == len(other.columns) == 1
                and (other.points, other.own_clock) == (proposal.points, proposal.own_clock)
                and used_columns.isdisjoint(other.columns)
            ]  # fmt: skip
            joined = tuple(column for other in alike[:MOST_COMPONENTS] for column in other.columns)
            proposals[channel] = replace(proposal, columns=joined or proposal.columns)
            used_columns.update(proposals[channel].columns)
    places = {name: place for place, name in enumerate(table.columns)}
    in_order = sorted(proposals.items(), key=lambda item: (item[1].own_clock is not None, places[item[1].columns[0]]))
    return dict(in_order)


def _vectors(table: Table, clock_names: list[str]) -> Iterator[Vector]:
    """Yield the vectors of a table, those on the clock of the time first, then those with a clock of their own."""
    clock = clock_names[0] if clock_names else None
    rows = table.rows(clock) if clock else max(table.rows(name) for name in table.columns)
    topic = table.topics.get(clock) if clock else None
    # The first clock of each topic: going backwards, it is the last to be put in.
    clock_of = {table.topics[name]: name for name in reversed(clock_names) if name in table.topics}
    groups: dict[tuple[str, str | None], dict[str, str]] = {}
    for name in table.columns:
        on_time_clock = table.rows(name) == rows and table.topics.get(name) == topic
        own = None if on_time_clock else clock_of.get(table.topics.get(name, ""))
        if name not in clock_names and (on_time_clock or own is not None):
            plain = _without_unit(name).removesuffix(f"/{table.units.get(name)}")
            part = COMPONENT_NAME.fullmatch(plain)
            # `pos.x`, `pos.y` and `pos.z` share the stem `pos`, and become one vector.
            stem = part["stem"] if part else plain
            groups.setdefault((stem, own), {}).setdefault(part["part"].lower() if part else "", name)
    for (stem, own), names in sorted(groups.items(), key=lambda group: group[0][1] is not None):
        # A w by itself is of no quaternion: `elbow`.
        alone = tuple(names) == ("w",)
        yield Vector(f"{stem}w" if alone else stem, ("",) if alone else tuple(names), tuple(names.values()), own)


def _scored(table: Table, vector: Vector, channel: str) -> Proposal | None:
    """Return what speaks for a vector as a channel; None where something excludes it, or too little speaks for it."""
    # A file of ours has the channels' own names.
    if vector.stem.rpartition(".")[2] == channel and len(vector.columns) <= MOST_COMPONENTS:
        return Proposal(vector.columns, vector.own_clock, 100.0)
    if channel not in WORDS:
        return None
    # A unit is a word as well: counts.
    labels = " ".join(f"{table.notes.get(name, '')} {_unit(table, name)}" for name in vector.columns)
    leaf = _words(f"{re.split(r'[./]', vector.stem)[-1]} {labels}")
    around = _words(f"{table.topics.get(vector.columns[0], '')} {vector.stem}") - leaf
    letters = bool(set("wxyz") & set(vector.parts))
    joints = channel.startswith("joint_") or channel in WIRED_CHANNELS
    of_joints = "joint" in leaf | around
    # Joints are counted; x, y and z are of the world, and with w they are a quaternion.
    excluded = (
        len(vector.columns) > MOST_COMPONENTS
        or bool(OTHER_WORDS & leaf)
        or bool(OTHER_WORDS & around and not WORDS[channel] & leaf)
        or "w" in vector.parts
        or (joints and letters)
        or (of_joints and not joints)
        # The torque of a wrench acts at the hand.
        or (channel == "joint_torque" and "wrench" in leaf | around)
        # A place or a velocity along axes, whose name is that of joints as well.
        or (channel in ("joint_position", "joint_velocity") and leaf & WORDS[channel] <= {"position", "velocity"}
            and not of_joints and _unit(table, vector.columns[0]) == NOT_STATED)
    )  # fmt: skip
    values = [table[name] for name in vector.columns]
    integers = all(column.dtype.kind == "i" for column in values)
    if excluded or (channel == "raw" and not integers and "raw" not in leaf):
        return None
    points, reasons = 0.0, []
    named, path = sorted(leaf & WORDS[channel]), sorted(around & WORDS[channel])
    if named:
        points, reasons = 2.0 + 0.1 * len(named), [f"'{named[0]}' in its name"]
    elif channel == "hip" and vector.stem == "" and letters:
        points, reasons = 2.0, ["axes without a name"]
    elif path:
        points, reasons = 1.5, [f"'{path[0]}' in its path"]
    points += 0.5 * bool(named and path)
    stated = {_unit(table, name) for name in vector.columns}
    for unit in stated - {NOT_STATED}:
        channel_unit = ("counts" if channel == "raw" else None) if channel in WIRED_CHANNELS else CHANNELS[channel].unit
        if channel_unit is not None and parse_unit(unit).dimension != parse_unit(channel_unit).dimension:
            return None
        points += 1.0
        reasons.append(f"in {unit}")
    if not joints and len(vector.columns) > 1:
        points += 0.5
        reasons.append(f"{len(vector.columns)} components")
    points += 1.0 * (of_joints and joints) + 0.5 * (channel == "raw" and integers)
    points -= 1.5 * bool(DOUBTFUL_WORDS & (leaf | around) and channel not in WIRED_CHANNELS)
    if not any(np.ptp(column[np.isfinite(column)]) for column in values if np.isfinite(column).any()):
        points -= 0.5
        reasons.append("it never changes")
    return Proposal(vector.columns, vector.own_clock, points, tuple(reasons)) if points >= LEAST_POINTS else None


def _channel(table: Table, channel: str, proposal: Proposal, *, ours: bool) -> list[str]:
    """Return the lines of one `[channels.NAME]`, with the reason, and a remark on each of its columns."""
    units = {_unit(table, name) for name in proposal.columns}
    unit = units.pop() if len(units) == 1 else NOT_STATED
    meaning, si_unit = WIRED_CHANNELS.get(channel) or CHANNELS[channel].meaning, ""
    if channel in CHANNELS:
        si_unit = f" ({CHANNELS[channel].unit})"
    elif channel == "raw" and unit == NOT_STATED:
        unit = "counts"
    sign = ['sign = "?"  # 1 or -1']
    if ours or channel not in DIRECTED_CHANNELS:
        axes = "the axes of the file are taken for those of the model; turned ones: axes = [[...], ...]"
        sign = ["sign = 1" if ours or channel not in ("hip", "ihip", "velocity") else f"sign = 1  # {axes}"]
    lines = [
        f"[channels.{channel}]  # {meaning}{si_unit}",
        *([f"# proposed for: {', '.join(proposal.reasons)}"] if proposal.reasons else []),
        *(f"#   {toml_text(name)}: {_remark(table, name)}" for name in proposal.columns),
        f"columns = {toml_text(list(proposal.columns))}",
        f"unit = {toml_text(unit)}",
        # What turns raw numbers is in [device].
        *([] if channel in WIRED_CHANNELS else sign),
    ]
    if proposal.own_clock is not None:
        lines += [f"time = {toml_text(proposal.own_clock)}", 'resample = "?"  # "hold" (the latest value) or "linear"']
    return lines


def _device(joints: int) -> list[str]:
    """Return the lines of `[device]`, which says what raw numbers mean: HIP, velocity and force follow from it."""
    kind = f"parallelogram-{joints}dof" if joints > 1 else NOT_STATED
    return [
        "[device]  # what the raw numbers mean: HIP, velocity and force follow from it, and need no columns",
        f'kind = "{kind}"  # hapticeval list devices',
        'counts_per_turn = "?"  # of the encoder at the joint, gear and quadrature included; without it raw is in rad',
        f'offsets = "?"  # raw readings at joint angle zero: {[0] * joints}',
        f'directions = "?"  # -1 where encoder and motor turn the other way round: {[1] * joints}',
        'torque_per_command = "?"  # N m that one unit of the command gives; 1 where commands are torques in N m',
        "# l1 = 0.3  # any parameter of Table A.1 that is different on your robot: hapticeval list devices",
    ]


def _words(text: str) -> frozenset[str]:
    """Return the words of a name, in small letters and without a plural s, and two that follow each other as one."""
    parts = re.findall(r"[^\W\d_]+", re.sub(r"(?<=[a-z])(?=[A-Z])", " ", text))
    words = [re.sub(r"(?<=\w{3})s$", "", part.lower()) for part in parts]
    return frozenset(words) | {f"{first}{second}" for first, second in pairwise(words)}


def _leaf(name: str) -> str:
    """Return the last part of a path as `scope.time` or `/wrench.header.stamp`, without a unit."""
    return SUFFIX_SECONDS.sub("", _without_unit(re.split(r"[./]", HEADER_UNIT.sub("", name))[-1].strip()))


def _without_unit(name: str) -> str:
    """Return the name of a column without the unit that it ends with."""
    return SUFFIX_UNIT.sub("", HEADER_UNIT.sub("", name))


def _unit(table: Table, name: str) -> str:
    """Return the unit that the file states, that the label of a column ends with in brackets, or its name."""
    stated = LABEL_UNIT.search(table.notes.get(name, "")) or SUFFIX_UNIT.search(name)
    unit = table.units.get(name) or (stated[1].strip() if stated else NOT_STATED)
    try:
        parse_unit(unit)
    except HapticevalError:
        return NOT_STATED
    return unit


def _remark(table: Table, name: str) -> str:
    """Return the rows, the range and the file's own words about a column."""
    values = table[name]
    finite = values[np.isfinite(values)]
    ends = (finite.min(), finite.max()) if finite.size else ()
    # A clock that counts from 1970 differs from its tenth digit on.
    digits = 6 if len({f"{end:.6g}" for end in ends}) == len(set(ends)) else 13
    span = " to ".join(f"{end:.{digits}g}" for end in ends) or "no number"
    note = f"; {table.notes[name]}" if name in table.notes else ""
    return " ".join(f"{values.size} rows, {span}{note}".split())
