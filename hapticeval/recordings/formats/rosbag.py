"""ROS 1 bags (.bag) and ROS 2 bags (a folder with metadata.yaml, or an .mcap), by the package `rosbags`.

Every topic has columns of its own and clocks of its own: `/wrench.received` is when the bag took the message, ns, and
`/wrench.header.stamp` when the sender made it, ns. Topics are never brought onto one clock here: the mapping says how.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from hapticeval.errors import HapticevalError, InputError
from hapticeval.recordings.formats import PICTURE_NUMBERS, Table, importer, missing_library
from hapticeval.recordings.memory import FOLDER_MARK, reserve

BYTES_A_NUMBER = 40
"""Bytes that a number takes while the messages are read."""


def _recognises(head: bytes) -> bool:
    if head.startswith(FOLDER_MARK):
        return b"metadata.yaml" in head.split(b"\n")
    return head.startswith((b"#ROSBAG V", b"\x89MCAP0\r\n"))


@importer("rosbag", about="a ROS 1 or ROS 2 bag, or an .mcap of one", recognises=_recognises)
def read_rosbag(path: Path) -> Table:
    """Columns `topic.field`; numbers in arrays as `topic.field[0]`. Raises `HapticevalError` without `rosbags`."""
    try:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
    except ImportError as error:
        raise missing_library(path, "a ROS bag", "rosbags", "ros", error) from error
    columns: dict[str, list[int | float]] = {}
    topics: dict[str, str] = {}
    rows: dict[str, int] = {}
    counted: dict[str, int] = {}
    size = 0
    try:
        with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
            # What the bag's own index counts by topic: a bag that was cut short gives fewer messages than that.
            for connection in reader.connections:
                counted[connection.topic] = counted.get(connection.topic, 0) + connection.msgcount
            for connection, received, raw in reader.messages():
                topic = connection.topic
                numbers: dict[str, int | float] = {f"{topic}.received": int(received)}
                _flatten(topic, reader.deserialize(raw, connection.msgtype), numbers)
                size += BYTES_A_NUMBER * len(numbers)
                reserve(size, f"{path}, as far as it was read,")
                # A number that is missing in one message stops its column there, which is then left out as a whole.
                expected = rows.setdefault(topic, 0)
                for name, value in numbers.items():
                    topics[name] = topic
                    # Only a column that had this number in every message before is still in step with its topic.
                    if len(columns.setdefault(name, [])) == expected:
                        columns[name].append(value)
                rows[topic] += 1
    except HapticevalError:
        raise
    except Exception as error:  # rosbags raises its own kinds for every store
        after = f", after {sum(rows.values())} messages" if rows else ""
        raise InputError(
            f"{path} cannot be read as a ROS bag{after}",
            why=f"{error}; a bag is found by its index, which one that was cut short has not got",
            todo=f"copy it again; on a copy try `rosbag reindex {path.name}`"
            if path.is_file()
            else "copy it again; see `ros2 bag info`",
        ) from error
    warnings = [
        f"the bag lacks {count - rows.get(topic, 0)} of the {count} messages of '{topic}' that it counts"
        for topic, count in counted.items()
        if count > rows.get(topic, 0)
    ]
    odd = [name for name in columns if len(columns[name]) != rows[topics[name]]]
    for name in odd:
        del columns[name], topics[name]
    remarks = [f"'{name}' is not in every message of its topic, and is left out" for name in odd]
    units = {name: "ns" for name in columns if name.endswith((".received", ".stamp"))}
    arrays = {name: np.array(values) for name, values in columns.items()}
    return Table(arrays, units=units, warnings=warnings, remarks=remarks, topics=topics)


def _flatten(name: str, value: Any, numbers: dict[str, int | float]) -> None:
    """The numbers of a message by their path; a stamp becomes nanoseconds."""
    # Truth values are numbers to a recording, 0 and 1.
    if isinstance(value, bool | int | float | np.number | np.bool_):
        numbers[name] = value.item() if isinstance(value, np.generic) else value
    elif hasattr(value, "nanosec") and hasattr(value, "sec"):
        numbers[name] = int(value.sec) * 1_000_000_000 + int(value.nanosec)
    elif isinstance(value, np.ndarray | list | tuple):
        for place, element in enumerate(value if len(value) <= PICTURE_NUMBERS else ()):
            _flatten(f"{name}[{place}]", element, numbers)
    elif hasattr(value, "__dataclass_fields__"):
        for part in value.__dataclass_fields__:
            # Fields as `__msgtype__` are rosbags' own, and not of the message.
            if not part.startswith("__"):
                _flatten(f"{name}.{part}", getattr(value, part), numbers)
