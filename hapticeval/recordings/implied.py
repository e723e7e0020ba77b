"""What a recording of HIP and force alone says of the model it touched, whatever the renderer.

Without damping the force is K_p (IHIP - HIP) of (6.1), so HIP + F / K_p is where the tool was: on the model in contact,
for every renderer that keeps its tool on the surface. And whatever stiffness and damping are: F = K_p (IHIP - HIP) -
K_d v pushes outwards as long as the HIP is inside and goes deeper, and there is no force where nothing is touched.
"""

from __future__ import annotations

import numpy as np

from hapticeval.geometry.model import Model
from hapticeval.recordings.finding import Fault, Severity
from hapticeval.recordings.impact import declared_floor
from hapticeval.recordings.inverse import QUANTA, Check, coarsest, judged, valid_rows, with_stiffness
from hapticeval.recordings.metadata import is_bilateral
from hapticeval.recordings.recording import Recording
from hapticeval.recordings.stretches import LAG, joined
from hapticeval.types import Array, BoolArray

IMPLIED, CONTACT = "spring and surface", "contact"
IMPLIES = "HIP + F / K_p on the model in contact (6.1)"
TOUCHES = "force where the HIP goes into the model, none outside"


def implied_tool(recording: Recording, model: Model, stiffness: float) -> Check:
    """HIP + F / K_p against the model's boundary wherever there is a force: residual in m. Its quantum is that of the
    HIP and of F / K_p; what the renderer declares of its own representation is allowed. Findings name the stiffness
    that fits best: the least squares of d + n . F / K_p, which is the distance to first order."""
    if not {"hip", "force"} <= recording.channels.keys():
        return Check(IMPLIED, IMPLIES, why="the log has no hip or no force")
    rows = valid_rows(recording)
    grain = coarsest(recording.force[rows].T)
    rows = rows[np.linalg.norm(recording.force[rows], axis=1) > max(QUANTA * grain, declared_floor(recording) or 0.0)]
    if rows.size == 0:
        return Check(IMPLIED, IMPLIES, why="the log has no force beyond its resolution")
    hip, force = recording.hip[rows], recording.force[rows]
    residual = np.abs(model.boundary.frame(hip + force / stiffness).distance)
    step = coarsest(recording.hip[rows].T) + grain / stiffness
    allowed = step + (recording.standoff + recording.resolution) / QUANTA
    check = judged(
        recording, rows, residual, allowed, IMPLIED, "force", "m",
        "see model, stiffness, damping and the frames of HIP and force; the log has no IHIP to tell them apart",
        size=model.size, relation=IMPLIES,
    )  # fmt: skip
    frame = model.boundary.frame(hip)
    along = np.sum(frame.normal * force, axis=1)
    against = -float(np.dot(frame.distance, along))
    return with_stiffness(check, stiffness, float(np.dot(along, along)) / against) if against > 0.0 else check


def contact(recording: Recording, model: Model) -> Check:
    """Whether the force is where the model is: there is one while the HIP is inside and goes deeper, and none while it
    is outside, each through `LAG` ticks, by which a renderer may be late. The residual is how deep without a force, or
    how far off with one, m.

    A surface that holds from both sides (a scene that is `bilateral`) pulls outside: only the inside is told then.
    """
    if not {"hip", "force"} <= recording.channels.keys():
        return Check(CONTACT, TOUCHES, why="the log has no hip or no force")
    rows = valid_rows(recording)
    # the renderer acts on what the sensors gave it
    place = recording.channels.get("measured_hip", recording.hip)
    distance = np.full(len(recording), np.nan)
    distance[rows] = model.boundary.frame(place[rows]).distance
    step = coarsest(place[rows].T)
    allowed = QUANTA * step + recording.standoff + recording.resolution
    size = np.linalg.norm(recording.force, axis=1)
    grain = max(QUANTA * coarsest(recording.force[rows].T), declared_floor(recording) or 0.0)
    nearest, farthest = _through(recording, distance, np.minimum), _through(recording, distance, np.maximum)
    deeper = np.zeros(len(recording), dtype=bool)
    deeper[1:] = np.diff(distance) <= 0.0
    deeper = _through(recording, np.where(deeper, 1.0, 0.0), np.minimum) > 0.0
    bare = (size <= grain) & deeper & (farthest < -allowed)
    held = is_bilateral(recording.meta)
    away = (size > grain) & (nearest > allowed) & (not held)
    off = np.where(bare, -farthest, np.where(away, nearest, 0.0))[rows]
    faults = [
        _fault(recording, wrong, reach, words)
        for wrong, reach, words in (
            (bare, -farthest, "no force though the HIP goes deeper inside the model, by up to {:.3g} mm"),
            (away, nearest, "a force though the HIP is outside the model, by up to {:.3g} mm"),
        )
        if wrong.any()
    ]
    return Check(
        CONTACT, TOUCHES, "m", int(rows.size), float(off.max(initial=0.0)), float(np.median(off)) if off.size else 0.0,
        allowed / QUANTA, tuple(faults), "" if rows.size else "not one row is valid",
    )  # fmt: skip


def _fault(recording: Recording, wrong: BoolArray, reach: Array, words: str) -> Fault:
    at = np.flatnonzero(wrong)
    first, last = int(at[0]), int(at[-1])
    return Fault(
        CONTACT,
        Severity.SUSPICIOUS,
        f"{words.format(1e3 * float(reach[wrong].max()))}, at {at.size} rows",
        "see the model, its size and its frame; a motor that is off or a force of something else does so too",
        "force",
        first,
        last + 1,
        (float(recording.time[first]), float(recording.time[last])),
        {"residual": float(reach[wrong].max()), "rows": int(at.size)},
    )


def _through(recording: Recording, values: Array, extreme: np.ufunc) -> Array:
    """The extreme of each row and the `LAG` before it; NaN where one of these is not there, or behind a gap."""
    out = values.copy()
    broken = np.concatenate([[True], ~joined(recording)])
    for back in range(1, LAG + 1):
        before = np.concatenate([np.full(back, np.nan), values[:-back]])[: values.size]
        out = extreme(out, before)
        out[np.convolve(broken, np.ones(back))[: values.size] > 0.0] = np.nan
    return out
