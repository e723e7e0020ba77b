"""A recording of a body that moves, seen from the body or from the world.

What is recorded and judged is in the frame of the body, with its pose as two channels; people look at the world.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from hapticeval.errors import at
from hapticeval.geometry.pose import Pose, check_pose, turn_in_plane
from hapticeval.types import Array

if TYPE_CHECKING:
    from hapticeval.recordings.recording import Recording

POSE_CHANNELS = ("body_rotation", "body_translation")
"""The channels of a pose: the matrix row by row, (n, N N), and the translation (n, N), m."""


LOG_ROUNDING = 2e-3
"""How far the lengths of a logged rotation may be from 1: three digits."""


def pose_channels(pose: Pose) -> dict[str, Array]:
    """Return the channels of poses, one a row."""
    count, size = pose.translation.shape
    return dict(zip(POSE_CHANNELS, (pose.rotation.reshape(count, size * size), pose.translation), strict=True))


def poses_of(channels: Mapping[str, Array]) -> Pose | None:
    """Return the poses of the body, one a row: of channels (n, N^2), 1, and (n, N), m; None of a body at rest."""
    if not channels.keys() >= set(POSE_CHANNELS):
        return None
    rotation, translation = (channels[name] for name in POSE_CHANNELS)
    count, size = translation.shape
    return Pose(rotation.reshape(count, size, size), translation)


def rotation_rows(columns: Array, size: int) -> Array:
    """Return rotations as the channel has them, (n, N N), of a log's columns, with N = `size`.

    These are angles (n,), rad, in the plane; unit quaternions (n, 4), w first, in space; or the matrices themselves.
    What is off a rotation by `LOG_ROUNDING` at the most is brought to the nearest one; anything else stays none.
    """
    if columns.ndim == 1:
        return turn_in_plane(columns).reshape(-1, 4)
    if size == 2 or columns.shape[1] == size * size:
        return _nearest_rotations(columns.reshape(-1, size, size)).reshape(columns.shape)
    lengths = np.linalg.norm(columns, axis=1, keepdims=True)
    columns = np.where(np.abs(lengths - 1.0) <= LOG_ROUNDING, columns / lengths, columns)
    # R = (w^2 - v.v) I + 2 v v^T + 2 w [v]x, of a unit quaternion; another one makes no rotation, and is refused
    w, x, y, z = columns.T
    rows = [
        *(w * w + x * x - y * y - z * z, 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)),
        *(2.0 * (x * y + w * z), w * w - x * x + y * y - z * z, 2.0 * (y * z - w * x)),
        *(2.0 * (x * z - w * y), 2.0 * (y * z + w * x), w * w - x * x - y * y + z * z),
    ]
    return np.column_stack(rows)


def _nearest_rotations(matrices: Array) -> Array:
    """Return matrices (n, N, N) with those that three digits explain as the nearest rotations: their polar factors."""
    finite = np.isfinite(matrices).all(axis=(1, 2))
    left, lengths, right = np.linalg.svd(matrices[finite])
    near = np.all(np.abs(lengths - 1.0) <= LOG_ROUNDING, axis=1)[:, np.newaxis, np.newaxis]
    nearest = matrices.copy()
    nearest[finite] = np.where(near, left @ right, matrices[finite])
    return nearest


def in_world(recording: Recording) -> Recording:
    """Return a recording as the world saw it, itself of a body at rest; its poses stay with it."""
    return _in_frame(recording, world=True)


def in_body(recording: Recording) -> Recording:
    """Return a recording of the world's frame, with the poses of the body, in the frame of the body.

    Raises `InputError`, naming the row, for a pose that is not a rotation.
    """
    poses = poses_of(recording.channels)
    if poses is not None:
        for row in np.flatnonzero(recording.measured):
            with at(f"row {row}"):
                check_pose(poses.rotation[row], poses.translation[row], poses.translation.shape[1])
    return _in_frame(recording, world=False)


def _in_frame(recording: Recording, *, world: bool) -> Recording:
    """Return a recording with its channels of places, velocities and forces in the other frame."""
    poses = poses_of(recording.channels)
    if poses is None:
        return recording
    channels = dict(recording.channels)
    # the pose of the row before, of which differences backwards are made; of the first row its own
    before = Pose(*(np.concatenate([values[:1], values[:-1]]) for values in poses))
    ticks = np.diff(recording.time, prepend=recording.time[0] - 1.0)[:, np.newaxis]
    hip = channels.get("hip")
    if hip is not None and not world:
        hip = poses.to_body(hip)
    for name, values in recording.channels.items():
        signal = recording.signals[name]
        if signal.frame != "world":
            continue
        if signal.unit == "m":
            channels[name] = poses.to_world(values) if world else poses.to_body(values)
        elif signal.unit == "m/s" and hip is not None:
            convert = poses.velocity_in_world if world else poses.velocity_in_body
            channels[name] = convert(before, hip, values, ticks)
        else:
            channels[name] = poses.turned(values) if world else poses.turned_back(values)
    # a row after a gap has no pose before it, and so no velocity of the body under it
    finite = [np.isfinite(values.reshape(len(recording), -1)).all(axis=1) for values in channels.values()]
    return replace(recording, channels=channels, valid=recording.measured & np.all(finite, axis=0))
