"""A log with a pose: hip, velocity and force of the world come into the frame of the body, where checks read them."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from hapticeval.errors import InputError
from hapticeval.recordings.formats import Table
from hapticeval.recordings.importing.convert import convert
from hapticeval.recordings.importing.mapping import parse_mapping
from hapticeval.recordings.integrity.relations import copies
from hapticeval.recordings.recording import Recording, backward_difference
from hapticeval.recordings.world import in_world, pose_channels
from hapticeval.stimulus.motions import Spin

TIME = np.arange(200) * 1e-3
POSE = {
    "angle": {"rotation": ["phi"], "angle": "deg"},
    "matrix": {"rotation": [f"r{k}" for k in range(4)]},
    "matrix in space": {"rotation": [f"r{k}" for k in range(9)]},
    "quaternion": {"rotation": ["w", "x", "y", "z"]},
}


def run_of(size):
    """A run in the frame of a body that spins."""
    motion = Spin(rate=0.7, centre=(0.1, 0.02), axis=None) if size == 2 else Spin(rate=0.7, axis=(1.0, 2.0, 3.0))
    hip = np.column_stack([0.1 + 0.01 * TIME, 0.02 * np.sin(9.0 * TIME), 0.03 * TIME])[:, :size]
    force = np.column_stack([np.cos(TIME), np.sin(TIME), TIME])[:, :size]
    channels = {"hip": hip, "ihip": hip + 1e-3, "force": force, "velocity": backward_difference(hip, TIME)}
    return Recording(TIME, channels | pose_channels(motion.pose(TIME)))


def log_of(recording, **columns):
    """The world's columns of it, as a tracker and a robot would log them."""
    world, size = in_world(recording), recording.dimension
    rotation = recording.channels["body_rotation"]
    logged = {"t": TIME} | {f"r{k}": rotation[:, k] for k in range(size**2)}
    logged |= {f"b{k}": 1e3 * recording.channels["body_translation"][:, k] for k in range(size)}
    for name in ("hip", "ihip", "force", "velocity"):
        logged |= {f"{name}{k}": world.channels[name][:, k] for k in range(size)}
    if size == 2:
        logged["phi"] = np.degrees(np.arctan2(rotation[:, 2], rotation[:, 0]))
    else:
        quaternions = Rotation.from_matrix(rotation.reshape(-1, 3, 3)).as_quat()
        logged |= dict(zip("xyzw", quaternions.T, strict=True))
    return Table({name: np.array(values) for name, values in (logged | columns).items()})


def mapping_of(size, **pose):
    units = {"hip": "m", "ihip": "m", "force": "N", "velocity": "m/s"}
    channels = {
        name: {"columns": [f"{name}{k}" for k in range(size)], "unit": unit, "sign": 1} for name, unit in units.items()
    }
    pose = {"translation": [f"b{k}" for k in range(size)], "unit": "mm", **pose}
    return parse_mapping({"time": {"column": "t", "unit": "s"}, "channels": {**channels, "pose": pose}})


@pytest.mark.parametrize("kind", POSE)
def test_a_log_of_the_world_is_read_in_the_frame_of_the_body(kind):
    size = 2 if kind in ("angle", "matrix") else 3
    recording = run_of(size)
    read = convert(log_of(recording), mapping_of(size, **POSE[kind]))
    for name in ("hip", "ihip", "force", "velocity", "body_rotation", "body_translation"):
        assert read.channels[name] == pytest.approx(recording.channels[name], abs=1e-9), name
    assert in_world(read).hip == pytest.approx(in_world(recording).hip, abs=1e-9)


@pytest.mark.parametrize("kind", ["matrix", "matrix in space", "quaternion"])
def test_a_pose_in_few_digits_is_the_nearest_rotation(kind):
    recording = run_of(2 if kind == "matrix" else 3)
    log = log_of(recording)
    rounded = {name: np.round(log[name], 5) for name in POSE[kind]["rotation"]}
    read = convert(log_of(recording, **rounded), mapping_of(recording.dimension, **POSE[kind]))
    assert read.channels["body_rotation"] == pytest.approx(recording.channels["body_rotation"], abs=2e-5)


def test_a_pose_that_is_missing_leaves_out_its_row_and_the_velocity_after_it():
    recording = run_of(2)
    angle = np.degrees(np.arctan2(recording.channels["body_rotation"][:, 2], recording.channels["body_rotation"][:, 0]))
    angle[50] = np.nan
    read = convert(log_of(recording, phi=angle), mapping_of(2, **POSE["angle"]))
    assert np.flatnonzero(~read.measured).tolist() == [50, 51]
    assert read.hip[60] == pytest.approx(recording.hip[60], abs=1e-9)


def test_a_matrix_that_repeats_its_numbers_is_no_copied_column():
    recording = run_of(2)
    assert [issue for issue in copies(recording) if "body_rotation" in issue.message + str(issue)] == []


@pytest.mark.parametrize(
    ("size", "pose"),
    [
        (2, {"rotation": ["phi"]}),
        (2, {"rotation": ["r0", "r1", "r2", "r3"], "angle": "deg"}),
        (2, {"rotation": ["phi", "r0"]}),
        (3, {"rotation": ["phi"], "angle": "deg"}),
        (2, {"rotation": ["phi"], "angle": "deg", "unit": "N"}),
    ],
)
def test_a_pose_of_columns_that_are_none_is_refused(size, pose, refused):
    with refused(InputError):
        mapping_of(size, **pose)


def test_a_matrix_that_is_no_rotation_is_refused_with_its_row(refused):
    recording = run_of(2)
    first = recording.channels["body_rotation"][:, 0].copy()
    first[7] += 1e-2
    with refused(InputError):
        convert(log_of(recording, r0=first), mapping_of(2, **POSE["matrix"]))
