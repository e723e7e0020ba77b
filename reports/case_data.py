"""What a case page holds of its runs: some thousand samples of each, chosen so that extremes stay, and the model.

`case_document` is what the page's script reads: JSON, in which arrays are base64 of little-endian floats.
"""

from __future__ import annotations

import base64
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from heapq import heapify, heappop, heappush
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from hapticeval.geometry.model import Model
from hapticeval.phenomena.sampling import LED
from hapticeval.recordings.provenance import before_the_wall
from hapticeval.recordings.recording import Recording, runs_of
from hapticeval.recordings.stretches import continuing_steps
from hapticeval.reports.canvas import MM
from hapticeval.reports.plane import Box, filled_part, solid_mesh
from hapticeval.types import Array, BoolArray, IntArray

if TYPE_CHECKING:
    from shapely import Geometry

THINNED_SAMPLES = 1000
"""At most about so many samples of a run are kept beside those that are kept for certain."""

CHANNEL_TOLERANCE = 1.0 / 500.0
"""Share of each channel's range that straight lines between the samples may be off: less than can be seen."""

DEPARTURE_LIMIT = 0.02
"""Share of a path's extent by which lines between its samples may leave it; else `drawn_rows` takes its ends only."""

INTERVALS = 12
"""The largest and smallest of force, depth and step in so many intervals are kept exactly."""

MOST_MARKED_EVENTS = 200
"""At most so many gaps, so many jumps and so many changes of contact are kept for certain; the longest jumps."""

JUMP_RATIO = 4.0
"""An IHIP step this many times as long as the HIP's, and as the shorter of the steps beside it, is kept: a jump."""

MOST_CONTACTS = 40
"""Of a run with more contacts than this, beginnings and ends are not marked: nothing else would be seen."""

IMPACT_SPEED = 0.02
"""Speed (m/s) towards the surface from which on the beginning of a contact in a closed loop is marked as an impact."""

EYE_AXES = np.array([[0.866, 0.5, 0.0], [-0.25, 0.433, 0.866], [0.433, -0.75, 0.5]])
"""From where a solid is seen first: rows are what lies to the right, up, and towards the eye, 30 degrees above."""

VIEW_RATIO = 3.0
"""An open model, or one far larger than the paths, is drawn this many times as far as they go."""


@dataclass(frozen=True)
class Track:
    """One run, at the samples that are shown: `rows` (n,) of the recording, and its channels there.

    What was not recorded is None.

    - `apart`: IHIP less HIP (n, N), m
    - `force` (n, N), N
    - `step` and `hip_step` (n,), m: how far IHIP and HIP move in the tick before each sample, see `_drawn_steps`
    - `starts`: the samples that begin after a gap
    """

    name: str
    rows: IntArray
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
    held_on: Model | None = None,
) -> list[Track]:
    """Return what is drawn of each recording: samples thinned as `thinned_rows` does, and those that verdicts name.

    `times` (s) are those of verdicts, by renderer. Runs along one hand path share their samples, so that the path is
    packed once.

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
        verdict_rows = {int(np.argmin(np.abs(time - moment))) for name in names for moment in times.get(name, ())}
        surface_signals = [column for name in names if name in motions for column in _surface_signals(*motions[name])]
        chosen = drawn_rows([recordings[name] for name in names], verdict_rows, extra_signals=surface_signals)
        rows = chosen.rows
        for name in names:
            track = _sample_track(name, recordings[name], chosen)
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


class DrawnRows(NamedTuple):
    """The `rows` to show; those of them that no line leads to, `cuts`; and between which times, s, few are shown."""

    rows: IntArray
    cuts: IntArray
    left_out: tuple[float, float] | None


def drawn_rows(
    runs: Sequence[Recording], ticks: Collection[int], count: int = THINNED_SAMPLES, extra_signals: Sequence[Array] = ()
) -> DrawnRows:
    """Return the rows to draw of runs along one hand path: `thinned_rows` where lines between them follow the path.

    So many samples cannot follow some paths, as a hundred laps. Of these are drawn:

    - the beginning and the end, as far as lines follow them ten times as closely as `DEPARTURE_LIMIT`
    - between them `ticks`, with the rows beside them

    `extra_signals`, each (n,) for the n rows of the runs, such as a speed in m/s, have to be followed too.
    """
    rows = thinned_rows(runs, ticks, count, extra_signals)
    if _largest_departure(runs, rows) <= DEPARTURE_LIMIT:
        return DrawnRows(rows, np.zeros(0, dtype=np.int64), None)
    # Lines cannot follow the whole path: start from `length` rows at either end, one after the other.
    n, length = len(runs[0]), count // 2

    def end(first: int, last: int) -> IntArray | None:
        part = slice(first, last)
        inside = [tick - first for tick in ticks if first <= tick < last]
        parts = [run.part(part) for run in runs]
        end_rows = thinned_rows(parts, inside, count // 2, [signal[part] for signal in extra_signals])
        return end_rows + first if _largest_departure(parts, end_rows) <= 0.1 * DEPARTURE_LIMIT else None

    ends = np.arange(length), np.arange(n - length, n)
    # Reach twice as far from both ends as long as half the samples still follow the path there.
    while 4 * length < n:
        first_rows, last_rows = end(0, 2 * length), end(n - 2 * length, n)
        if first_rows is None or last_rows is None:
            break
        ends, length = (first_rows, last_rows), 2 * length
    # In the part that is left out, each verdict has its row and the two beside it.
    rows_between = [k for tick in ticks for k in (tick - 1, tick, tick + 1) if length <= k < n - length]
    verdict_rows = np.unique(np.array(rows_between, dtype=np.int64))
    # No line leads to the first of neighbouring rows, nor to the first row of the end.
    cuts = np.append(verdict_rows[np.diff(verdict_rows, prepend=-1) > 1], n - length)
    time = runs[0].time
    return DrawnRows(
        np.concatenate([ends[0], verdict_rows, ends[1]]), cuts, (float(time[length - 1]), float(time[n - length]))
    )


def _largest_departure(runs: Sequence[Recording], rows: IntArray) -> float:
    """Return how far lines between the rows leave the paths of HIP and IHIP, as a share of the paths' extent."""
    time = runs[0].time
    columns = [*runs[0].hip.T, *(column for run in runs if "ihip" in run.channels for column in run.ihip.T)]
    # m: the largest distance of any coordinate from its interpolation between the chosen rows.
    off = max(float(np.max(np.abs(np.interp(time, time[rows], column[rows]) - column))) for column in columns)
    return off / max(*(float(np.ptp(column)) for column in columns), 1e-300)


def thinned_rows(
    runs: Sequence[Recording], ticks: Collection[int], count: int = THINNED_SAMPLES, extra_signals: Sequence[Array] = ()
) -> IntArray:
    """Return few rows of runs along one hand path: straight lines between them miss the others by `CHANNEL_TOLERANCE`.

    - For certain: ends, `ticks` and those beside them, gaps, contacts, jumps and extremes, with the row before each.
    - Then up to `count` more, always the row that is farthest from the lines.

    Lines follow HIP and IHIP (m), force (N) and the `extra_signals`, each (n,) for the n rows of the runs, in units of
    their own, such as m/s.
    """
    n = len(runs[0])
    if n <= count:
        return np.arange(n)
    # All runs share their rows: what one of them needs, all of them get.
    chosen = np.unique(np.concatenate([_certain_rows(run, ticks) for run in runs]))
    for signal in (signal for run in runs for signal in _signals_with_extremes(run)):
        chosen = np.union1d(chosen, _extremes(signal, INTERVALS))
    # Every column is scaled by its tolerance, so that one threshold of 1 holds for all.
    values = np.column_stack(
        [*(_channels_in_tolerances(run) for run in runs), *(_in_tolerances(signal) for signal in extra_signals)]
    )
    return _refined_rows(runs[0].time, values, chosen, count)


def _channels_in_tolerances(run: Recording) -> Array:
    """Return the channels that are drawn (n, k), each in units of the error that straight lines may have."""
    parts = [3.0 * _in_tolerances(run.hip)]  # a picture can be enlarged
    if "ihip" in run.channels:
        parts += [_in_tolerances(run.ihip - run.hip), _in_tolerances(step_lengths(run, run.ihip))[:, None]]
    if "force" in run.channels:
        parts.append(_in_tolerances(run.force))
    return np.hstack(parts)


def _in_tolerances(values: Array) -> Array:
    return values / max(CHANNEL_TOLERANCE * float(np.ptp(values, axis=0).max()), 1e-300)


def _refined_rows(time: Array, values: Array, chosen: IntArray, count: int) -> IntArray:
    """Add up to `count` rows, always the one that is farthest from the line between those chosen on its sides.

    `values` (n, k) are lines of `time` (n,) where they are off by less than 1.
    """
    rows = chosen.tolist()

    def farthest(first: int, last: int) -> tuple[float, int, int, int] | None:
        # Between neighbours there is nothing to add.
        if last - first < 2:
            return None
        # The straight line in time from first to last, and how far each row between is from it.
        share = ((time[first + 1 : last] - time[first]) / (time[last] - time[first]))[:, None]
        line = values[first] + share * (values[last] - values[first])
        departures = np.abs(values[first + 1 : last] - line).max(axis=1)
        farthest_index = int(np.argmax(departures))
        return (
            (-float(departures[farthest_index]), first, first + 1 + farthest_index, last)
            if departures[farthest_index] > 1.0
            else None
        )

    candidates = [candidate for pair in pairwise(rows) if (candidate := farthest(*pair)) is not None]
    # A heap with the farthest row on top: adding the worst row first is the greedy form of Douglas and Peucker.
    heapify(candidates)
    for _ in range(count):
        if not candidates:
            break
        _, first, middle, last = heappop(candidates)
        rows.append(middle)
        # The new row splits its interval into two, each with a farthest row of its own.
        for pair in ((first, middle), (middle, last)):
            candidate = farthest(*pair)
            if candidate is not None:
                heappush(candidates, candidate)
    return np.array(sorted(rows), dtype=np.int64)


def _signals_with_extremes(recording: Recording) -> list[Array]:
    """Return the signals whose extremes are kept: the size of the force (N), the depth and the IHIP's steps (m)."""
    signals = []
    if "force" in recording.channels:
        signals.append(np.linalg.norm(recording.force, axis=1))
    if "ihip" in recording.channels:
        signals += [np.linalg.norm(recording.ihip - recording.hip, axis=1), step_lengths(recording, recording.ihip)]
    return signals


def step_lengths(recording: Recording, points: Array) -> Array:
    """Return how far points move in the tick before each row, m; 0 where no row lies right before.

    `points` (n, N) are places of the recording's n samples, m; the result is (n,).
    """
    lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
    return (
        np.append(0.0, np.where(continuing_steps(recording), lengths, 0.0))
        if len(points) > 1
        else np.zeros(len(points))
    )


def _drawn_steps(recording: Recording, points: Array) -> Array:
    """Return `step_lengths` (n,), m, as they are drawn: a row that begins after a gap has the step that follows it.

    It has none of its own, and a line that rises from 0 would show a motion.
    """
    lengths = step_lengths(recording, points)
    if lengths.size < 2:
        return lengths
    begins = np.append(True, ~continuing_steps(recording))
    return np.where(begins, np.append(lengths[1:], 0.0), lengths)


def jump_rows(recording: Recording) -> IntArray:
    """Return the rows at which the IHIP has just jumped, the longest `MOST_MARKED_EVENTS` of them.

    A jump is a step `JUMP_RATIO` times as long as the HIP's and as the shorter of the steps before and after it, and at
    least half as long as the longer one.
    """
    if "ihip" not in recording.channels or len(recording) < 3:
        return np.zeros(0, dtype=np.int64)
    # m a tick.
    step, hip = step_lengths(recording, recording.ihip), step_lengths(recording, recording.hip)
    longer_neighbour = np.maximum(np.append(0.0, step[:-1]), np.append(step[1:], 0.0))
    # a jump of two ticks has a neighbour as long as itself: that of either side which is shorter decides
    shorter_neighbour = np.minimum(np.append(0.0, step[:-1]), np.append(step[1:], 0.0))
    # m: steps as short as rounding errors are no jumps.
    floor = 1e-6 * float(np.max(np.abs(recording.hip), initial=0.0))
    jumping = np.flatnonzero(
        (step > JUMP_RATIO * np.maximum(hip, shorter_neighbour)) & (step > floor) & (step >= 0.5 * longer_neighbour)
    )
    # The longest ones, back in the order of time.
    return np.sort(jumping[np.argsort(-step[jumping], kind="stable")[:MOST_MARKED_EVENTS]]).astype(np.int64)


def _certain_rows(recording: Recording, ticks: Collection[int]) -> IntArray:
    """Return the rows that are kept for certain: ends, verdicts' places, gaps, jumps, contacts, and the rows before."""
    n = len(recording)
    # A verdict's tick and the one after it; the ones before are added below.
    row_groups = [np.array([0, n - 1, *(tick + 1 for tick in ticks)]), np.array([*ticks], dtype=np.int64)]
    if n > 1:
        row_groups.append(np.flatnonzero(~continuing_steps(recording))[:MOST_MARKED_EVENTS] + 1)
    row_groups.append(jump_rows(recording))
    if {"ihip", "force"} & recording.channels.keys():
        row_groups.append(np.flatnonzero(np.diff(recording.contact))[:MOST_MARKED_EVENTS] + 1)
    rows = np.concatenate(row_groups).astype(np.int64)
    # What happens from one row to the next needs both.
    with_previous = np.union1d(rows, rows - 1)
    return with_previous[(with_previous >= 0) & (with_previous < n)]


def _extremes(signal: Array, intervals: int) -> IntArray:
    """Return the rows of the largest and the smallest value in each of so many intervals of equal length."""
    edges = np.linspace(0, signal.size, intervals + 1).astype(np.int64)
    parts = [(begin, signal[begin:end]) for begin, end in pairwise(edges) if end > begin]
    return np.unique([begin + int(pick(part)) for begin, part in parts for pick in (np.argmax, np.argmin)])


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
        rows=rows,
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


def floats(values: Array, *, double: bool = False) -> str:
    """Return numbers, row by row, as base64 of little-endian floats of 32 bits, or of 64 where `double`."""
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
    filled = filled_part(model, view)
    # Open, or far larger than the paths: only what the view holds of it.
    if not model.boundary.closed or view[2] - view[0] < MM * model.size:
        return filled
    import shapely

    depths = [np.linalg.norm(track.apart, axis=1).max(initial=0.0) for track in tracks if track.apart is not None]
    # mm: a thirtieth of the deepest penetration, but no finer than 1/200000 and no coarser than 1/2000 of the size.
    within = float(np.clip(MM * max(depths, default=0.0) / 30.0, MM * model.size / 2e5, MM * model.size / 2000.0))
    ring = shapely.make_valid(shapely.Polygon(MM * model.boundary.points(max(6000, 8 * len(model.boundary.corners)))))
    return shapely.simplify(ring, within)


def _view_around_paths(model: Model, tracks: Sequence[Track]) -> Box:
    """Return the box (mm) that is drawn of a model: round the paths, or the whole if it is not far larger."""
    points = MM * np.vstack([np.vstack([track.hip, track.ihip]) for track in tracks])
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
