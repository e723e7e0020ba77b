"""What a case page holds of its runs, the samples that `thinning` takes of each, and of the model.

The page's script reads it as JSON, in which arrays are base64 of little-endian floats.
"""

from __future__ import annotations

import base64
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from hapticeval.geometry.model import Model
from hapticeval.geometry.pose import Pose
from hapticeval.phenomena.sampling import LED
from hapticeval.recordings.provenance import before_the_wall
from hapticeval.recordings.recording import Recording, runs_of
from hapticeval.recordings.stretches import continuing_steps
from hapticeval.recordings.world import pose_channels, poses_of
from hapticeval.reports.canvas import MM, Look
from hapticeval.reports.chart import script_text
from hapticeval.reports.plane import Box, filled_part, solid_mesh
from hapticeval.reports.thinning import DrawnRows, drawn_rows, step_lengths
from hapticeval.types import Array, BoolArray, IntArray

if TYPE_CHECKING:
    from shapely import Geometry

MOST_CONTACTS = 40
"""A run with more contacts than this has no marks where they begin and end: nothing else would be seen."""

IMPACT_SPEED = 0.02
"""Speed (m/s) towards the surface from which on the beginning of a contact in a closed loop is marked as an impact."""

CLOSE_TICKS = 20
"""Ticks to either side of a verdict's place that a second plot shows: `draw.js` has the same number."""

EYE_AXES = np.array([[0.866, 0.5, 0.0], [-0.25, 0.433, 0.866], [0.433, -0.75, 0.5]])
"""From where a solid is seen first: rows are what lies to the right, up, and towards the eye, 30 degrees above."""

SMALLEST_DISTANCE = 1e-12
"""Distances (m) below this are rounding errors, and lie on the floor of a logarithmic panel."""

VIEW_RATIO = 3.0
"""An open model, or one far larger than the paths, is drawn this many times as far as they go."""


@dataclass(frozen=True)
class Track:
    """One run: its channels at the samples that are shown.

    What was not recorded is None.

    - `apart`: IHIP less HIP (n, N), m
    - `force` (n, N), N
    - `step` and `hip_step` (n,), m: how far IHIP and HIP move in the tick before each sample, see `_drawn_steps`
    - `starts`: the samples that begin after a gap
    """

    name: str
    time: Array
    hip: Array
    apart: Array | None
    force: Array | None
    step: Array | None
    hip_step: Array
    starts: IntArray
    dt: float
    """The sampling time, s. Where drawn samples are farther apart, a line stands for those between them."""
    led: bool
    """Whether the hand was led along a given path."""
    off: Array | None = None
    """The HIP's signed distance (n,), m, from the surface that it is held on; None where nothing holds it."""
    along: Array | None = None
    """The speed (n,), m/s, of the HIP's foot along that surface."""
    left_out: tuple[float, float] | None = None
    """The times, s, between which nothing but the places of verdicts is shown; None where all of it is."""
    pose: Pose | None = None
    """Where the body is at each sample, for the world to be drawn; None of a body at rest."""
    events: Sequence[tuple[float, str]] = ()
    """When (s) a contact or an impact begins, and when a contact ends: `contact`, `impact`, `release`."""

    @property
    def ihip(self) -> Array:
        """The IHIP (n, N), m; the HIP where none was recorded."""
        return self.hip if self.apart is None else self.hip + self.apart


def drawable_recording(recording: Recording) -> Recording:
    """Return the rows of a recording that are measurements, in the plane where it is in one dimension.

    A run in one dimension is drawn as a hand before a wall, m.
    """
    if recording.dimension == 1:
        recording = before_the_wall(recording)
    if recording.valid is None:
        return recording
    keep = recording.valid
    channels = {name: values[keep] for name, values in recording.channels.items()}
    return Recording(recording.time[keep], channels, recording.meta, signals=recording.signals)


def sample_tracks(
    recordings: Mapping[str, Recording],
    times: Mapping[str, Collection[float]],
    *,
    faults: Collection[float] = (),
    held_on: Model | None = None,
) -> list[Track]:
    """Return what is drawn of each recording: samples thinned as `thinned_rows` does, and those that verdicts name.

    `times` (s) are those of verdicts, by renderer, and round `faults` (s) each tick is drawn, `CLOSE_TICKS` to either
    side. Runs along one hand path share their samples, so that the path is packed once.

    Where a surface holds the tools it is that of the model `held_on`: tracks have the motion across and along it.
    """
    motions = (
        {} if held_on is None else {name: surface_motion(recording, held_on) for name, recording in recordings.items()}
    )
    # Runs with the same clock and hand path get the same rows, so that both are packed once.
    names_by_path: dict[tuple[bytes, bytes], list[str]] = {}
    for name, recording in recordings.items():
        names_by_path.setdefault((recording.time.tobytes(), recording.hip.tobytes()), []).append(name)
    track_by_name: dict[str, Track] = {}
    for names in names_by_path.values():
        time = recordings[names[0]].time
        # The sample nearest to each time that a verdict names.
        moments = {moment for name in names for moment in times.get(name, ())}
        verdict_rows = {int(np.argmin(np.abs(time - moment))) for moment in moments}
        for row in [int(np.argmin(np.abs(time - moment))) for moment in moments.intersection(faults)]:
            verdict_rows |= {*range(max(row - CLOSE_TICKS, 0), min(row + CLOSE_TICKS + 1, time.size))}
        surface_signals = [column for name in names if name in motions for column in _surface_signals(*motions[name])]
        poses = poses_of(recordings[names[0]].channels)
        # between two samples that are drawn a body turns and moves evenly
        turning = [] if poses is None else [*poses.rotation.reshape(len(time), -1).T, *poses.translation.T]
        turning = [column for column in turning if np.ptp(column) > 0.0]
        signals = [*surface_signals, *turning]
        chosen = drawn_rows([recordings[name] for name in names], verdict_rows, extra_signals=signals)
        rows = chosen.rows
        for name in names:
            track = _sample_track(name, recordings[name], chosen)
            if poses is not None:
                track = replace(track, pose=Pose(poses.rotation[rows], poses.translation[rows]))
            if name in motions:
                off, along = motions[name]
                track = replace(track, off=off[rows], along=along[rows])
            track_by_name[name] = track
    return [track_by_name[name] for name in recordings]


def _surface_signals(off: Array, along: Array) -> tuple[Array, ...]:
    """Return what is drawn of the motion on a surface: distance (m), speed (m/s), and the distance's power of ten."""
    # m: the logarithm must not spend samples on rounding errors near zero.
    floor = max(float(np.median(np.abs(off))), 1e-12) / 10.0
    return off, along, np.log10(np.maximum(np.abs(off), floor))


def _drawn_steps(recording: Recording, points: Array) -> Array:
    """Return `step_lengths` (n,), m, as they are drawn: a row that begins after a gap has the step that follows it.

    It has none of its own, and a line that rises from 0 would show a motion.
    """
    lengths = step_lengths(recording, points)
    if lengths.size < 2:
        return lengths
    begins = np.append(True, ~continuing_steps(recording))
    return np.where(begins, np.append(lengths[1:], 0.0), lengths)


def _sample_track(name: str, recording: Recording, chosen: DrawnRows) -> Track:
    """Take a recording's channels at the rows that are drawn."""
    rows = chosen.rows
    gaps: BoolArray = np.append(False, ~continuing_steps(recording)) if len(recording) > 1 else np.zeros(1, dtype=bool)
    # A cut is drawn like a gap of the recording.
    gaps[chosen.cuts] = True
    # Counts the gaps so far: it grows between two drawn rows where a gap lies between them.
    gaps_before = np.cumsum(gaps)[rows]
    has_ihip = "ihip" in recording.channels
    return Track(
        name=name,
        time=recording.time[rows],
        hip=recording.hip[rows],
        apart=(recording.ihip - recording.hip)[rows] if has_ihip else None,
        force=recording.force[rows] if "force" in recording.channels else None,
        step=_drawn_steps(recording, recording.ihip)[rows] if has_ihip else None,
        hip_step=_drawn_steps(recording, recording.hip)[rows],
        starts=np.flatnonzero(np.diff(gaps_before)) + 1,
        dt=recording.dt,
        led=recording.meta.get("source") in LED,
        left_out=chosen.left_out,
        events=contact_events(recording),
    )


def contact_events(recording: Recording) -> list[tuple[float, str]]:
    """Return when (s) contacts begin and end: `contact`, `impact`, `release`; none of a run with very many.

    An impact is the beginning of a contact in a closed loop at which the HIP moves towards the surface, against the
    offset of the IHIP or else against the force, at `IMPACT_SPEED` or faster.
    """
    if not {"ihip", "force"} & recording.channels.keys() or len(recording) < 3:
        return []
    contacts = list(runs_of(recording.contact))
    if len(contacts) > MOST_CONTACTS:
        return []
    # What points away from the surface, where it was recorded.
    outward = [recording.ihip - recording.hip] if "ihip" in recording.channels else []
    outward += [recording.force] if "force" in recording.channels else []
    events = []
    for first, end in contacts:
        # A contact that is there from the first row on was not seen to begin; one at the last row did not end.
        if first > 0:
            normal = next((vectors[first] for vectors in outward if vectors[first].any()), outward[0][first])
            step = recording.hip[first] - recording.hip[first - 1]
            # m/s towards the surface, where there is a direction.
            approach = -float(step @ normal) / max(float(np.linalg.norm(normal)), 1e-300) / recording.dt
            is_impact = recording.meta.get("source") not in LED and approach >= IMPACT_SPEED
            events.append((float(recording.time[first]), "impact" if is_impact else "contact"))
        if end < len(recording):
            events.append((float(recording.time[end]), "release"))
    return events


def surface_motion(recording: Recording, model: Model) -> tuple[Array, Array]:
    """Return the HIP's signed distance (n,), m, and the speed of its foot along the surface (n,), m/s.

    In the plane the speed has the sign of the tangent; P_T ẏ = (I + n W) ṗ.
    """
    frame = model.boundary.closest_point(recording.hip)
    velocity = recording.velocity
    # Leave the velocity's tangential part, P_T ẏ.
    across = np.sum(velocity * frame.normal, axis=1)[:, None] * frame.normal
    count = recording.hip.shape[1]
    # I + n W with the shape operator W: how much longer a path off the surface is than its foot's.
    stretch = np.eye(count) + frame.distance[:, None, None] * frame.shape
    foot = np.linalg.solve(stretch, (velocity - across)[..., None])[..., 0]
    if count == 2:
        tangent = np.column_stack([-frame.normal[:, 1], frame.normal[:, 0]])
        return frame.distance, np.sum(foot * tangent, axis=1)
    return frame.distance, np.linalg.norm(foot, axis=1)


class Term(NamedTuple):
    """One line of a panel: a `channel` of the track, of it one `column`, or of vectors the length; and its label.

    `is_size`: lengths of vectors, and numbers without their sign.
    """

    channel: str
    label: str
    column: int | None = None
    is_size: bool = False

    @property
    def script_name(self) -> str:
        """The name that the script reads: "force.1" of a column, "|force|" of a size."""
        if self.is_size:
            return f"|{self.channel}|"
        return self.channel if self.column is None else f"{self.channel}.{self.column}"


@dataclass(frozen=True)
class Panel:
    """One plot against time: the label of its axis, and what is drawn of each run; see `Term`.

    Of `terms` the first is drawn of every run, the others where one run is shown alone.
    """

    label: str
    terms: tuple[Term, ...]
    powers: tuple[float, float] | None = None
    """Of a logarithmic axis, both ends."""


def case_panels(tracks: Sequence[Track]) -> list[Panel]:
    """Return the panels of a case: force, and steps or depth; of a hand that is held on a surface its distance."""
    panels = []
    # A run in one dimension, which lies on the second axis: its place says what the plane cannot.
    if all(track.hip.shape[1] == 2 and not track.hip[:, 0].any() for track in tracks):
        panels.append(Panel("place (mm)", (Term("hip", "HIP", column=1), Term("ihip", "IHIP", column=1))))
    widest = max((track.hip.shape[1] for track in tracks), default=2)
    if any(track.force is not None for track in tracks):
        parts = tuple(Term("force", f"F{'₁₂₃'[k]}", column=k) for k in range(widest))
        panels.append(Panel("force (N)", (Term("force", "|F|", is_size=True), *parts)))
    if any(track.off is not None for track in tracks):
        panels.append(Panel("off the surface (mm)", (Term("off", "off"),)))
        panels.append(Panel("the same, size (mm)", (Term("off", "off", is_size=True),), powers=_power_range(tracks)))
        panels.append(Panel("speed along it (m/s)", (Term("along", "along"),)))
    # Without an IHIP there is neither depth nor its step: the hand alone is drawn.
    elif any(track.apart is None for track in tracks) and len(tracks) == 1:
        panels.append(Panel("HIP step a tick (mm)", (Term("hip_step", "HIP"),)))
    # On a given path a tool that jumps farther than the hand moves is pop-through.
    elif all(track.led for track in tracks):
        panels.append(Panel("step a tick (mm)", (Term("step", "IHIP"), Term("hip_step", "HIP"))))
    else:
        panels.append(Panel("depth (mm)", (Term("apart", "depth", is_size=True),)))
    return panels


def _power_range(tracks: Sequence[Track]) -> tuple[float, float]:
    """Return the ends of a logarithmic panel, whole powers of ten in mm.

    The lower is at the median of the run that keeps closest to the surface, the upper above the farthest.
    """
    sizes = [np.abs(track.off) for track in tracks if track.off is not None]
    # m: the best run's median is the floor, so that it is not all below the panel.
    closest = max(min(float(np.median(size)) for size in sizes), SMALLEST_DISTANCE)
    worst = max(*(float(size.max()) for size in sizes), 10.0 * SMALLEST_DISTANCE)
    return float(MM * 10.0 ** np.floor(np.log10(closest))), float(MM * 10.0 ** (np.ceil(np.log10(worst)) + 0.3))


def floats(values: Array, *, double: bool = False) -> str:
    """Return `values` (n,) or (n, k), in s, m or N, row by row as base64 of little-endian floats of 32 or 64 bits."""
    return base64.b64encode(np.ascontiguousarray(values, dtype="<f8" if double else "<f4").tobytes()).decode("ascii")


def tracks_document(tracks: Sequence[Track]) -> dict[str, Any]:
    """Return `paths`, a hand's clock and path that several runs may share, and `runs`, which name theirs by number.

    Times are doubles, so that a sample a tick long is met after hours, too.
    """
    paths: dict[bytes, dict[str, Any]] = {}
    runs = []
    for track in tracks:
        path = {
            "time": floats(track.time, double=True),
            "hip": floats(track.hip),
            "hip_step": floats(track.hip_step),
            "starts": track.starts.tolist(),
        }
        if track.pose is not None:
            path |= {name: floats(values) for name, values in pose_channels(track.pose).items()}
        key = track.time.tobytes() + track.hip.tobytes()
        paths.setdefault(key, path)
        channels = {
            "apart": track.apart, "force": track.force, "step": track.step, "off": track.off, "along": track.along
        }  # fmt: skip
        runs.append(
            {
                "name": track.name,
                "path": list(paths).index(key),
                "dt": track.dt,
                "events": track.events,
                **{name: floats(values) for name, values in channels.items() if values is not None},
            }
        )
    return {"paths": list(paths.values()), "runs": runs}


def model_document(model: Model | None, tracks: Sequence[Track]) -> dict[str, Any] | None:
    """Return the outline of a model in the plane as `rings` (m), or its `vertices` (m) and `triangles`."""
    if model is None:
        return None
    if model.dimension == 3:
        mesh = solid_mesh(model)
        return {
            "closed": True,
            "vertices": floats(mesh.vertices),
            "triangles": mesh.triangles.ravel().tolist(),
            "turn": EYE_AXES.tolist(),
        }
    import shapely

    # Holes are rings of their own; the script fills by the even-odd rule.
    parts = shapely.get_parts(_outline(model, tracks))
    rings = [ring for part in parts if part.geom_type == "Polygon" for ring in (part.exterior, *part.interiors)]
    return {"closed": model.boundary.closed, "rings": [floats(shapely.get_coordinates(ring) / MM) for ring in rings]}


def _outline(model: Model, tracks: Sequence[Track]) -> Geometry:
    """Return what the model fills round the paths, mm: a closed outline as fine as the penetration depth asks for."""
    view = _view_around_paths(model, tracks)
    # Open, or far larger than the paths: only what the view holds of it.
    if not model.boundary.closed or view[2] - view[0] < MM * model.size:
        return filled_part(model, view)
    import shapely

    depths = [np.linalg.norm(track.apart, axis=1).max(initial=0.0) for track in tracks if track.apart is not None]
    # mm: a thirtieth of the deepest penetration, but no finer than 1/200000 and no coarser than 1/2000 of the size.
    within = float(np.clip(MM * max(depths, default=0.0) / 30.0, MM * model.size / 2e5, MM * model.size / 2000.0))
    ring = shapely.make_valid(shapely.Polygon(MM * model.boundary.points(max(6000, 8 * len(model.boundary.corners)))))
    return shapely.simplify(ring, within)


def _view_around_paths(model: Model, tracks: Sequence[Track]) -> Box:
    """Return the box (mm) that is drawn of a model: round the paths, or the whole if it is not far larger."""
    paths = [np.vstack([track.hip, track.ihip]) for track in tracks]
    # Without a path the whole of a closed model is shown.
    corners = np.reshape(model.boundary.bounds, (2, 2)) if model.boundary.closed else np.zeros((1, 2))
    points = MM * np.vstack(paths or [corners])
    low, high = points.min(axis=0), points.max(axis=0)
    # mm; at least 1.5 where nothing moves.
    half = 0.5 * VIEW_RATIO * max(float(np.ptp(points, axis=0).max()), 1.0)
    middle = 0.5 * (low + high)
    low, high = middle - half, middle + half
    if model.boundary.closed:
        bounds = MM * np.array(model.boundary.bounds)
        # A model that is not far larger is shown whole.
        if np.all(np.abs(bounds - np.tile(middle, 2)) < 3.0 * half):
            low, high = np.minimum(low, bounds[:2]), np.maximum(high, bounds[2:])
    return float(low[0]), float(low[1]), float(high[0]), float(high[1])


@dataclass(frozen=True)
class Mark:
    """A place to be ringed: the place of its run among the tracks, the time (s), and what is written at it."""

    run: int
    time: float
    number: str = ""


def case_text(
    title: str,
    tracks: Sequence[Track],
    model: Model | None,
    looks: Mapping[str, Look],
    *,
    numbers: Mapping[str, int] | None = None,
    crosses: Mapping[str, Sequence[float]] | None = None,
    marks: Sequence[Mark] = (),
    time: float | None = None,
) -> str:
    """Return what the script of a page reads of a case, as JSON.

    - `title`: what a screen reader says of the picture; `looks`: by renderer
    - `numbers`: the number by which the page calls a renderer's run; `crosses`: points (m) where one refuses the model
    - `marks`, `time` (s): what a picture that nobody moves shows; of the page of a case its verdicts say so
    """
    document = tracks_document(tracks)
    for run in document["runs"]:
        look = looks[run["name"]]
        run |= {
            "role": look.role,
            "dash": look.dash,
            "shape": look.shape,
            "number": (numbers or {}).get(run["name"], 0),
        }
    panels = [
        {"label": panel.label, "terms": [(term.script_name, term.label) for term in panel.terms], "range": panel.powers}
        for panel in (case_panels(tracks) if tracks else ())
    ]
    document |= {
        "title": title,
        "dimension": int(tracks[0].hip.shape[1]) if tracks else model.dimension if model is not None else 2,
        "panels": panels,
        "model": model_document(model, tracks),
        "crosses": crosses or {},
        "marks": [vars(mark) for mark in marks],
        "time": time,
    }
    return script_text(document)
