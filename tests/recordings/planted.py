"""Logs of a hand on a cube: clean ones of many sensors, and the same with one fault planted in each.

A hand presses and slides on the top of a cube of 100 mm and on its side, K = 500 N/m, at 1 kHz, and is free between.
"""

from collections.abc import Callable

import numpy as np

from hapticeval.geometry.catalogue import make_model
from hapticeval.recordings.recording import Recording

STIFFNESS = 500.0
CUBE = make_model("cube", size=0.1)
SEED = 5
X, Y, Z = np.eye(3)


def path(seconds=6.0, rate=1000.0, *, speed=1.0):
    """Time (n,), s, and the hand (n, 3), m: half of the time over the top, half beside the side x = 50 mm."""
    time = np.arange(round(rate * seconds)) / rate
    turn = speed * time
    over = np.column_stack([0.02 * np.sin(2.1 * turn), 0.05 + 0.004 * np.sin(3.3 * turn), 0.015 * np.cos(1.3 * turn)])
    beside = np.column_stack(
        [0.05 + 0.003 * np.sin(2.9 * turn + 2.0), 0.018 * np.cos(1.7 * turn), 0.02 * np.sin(2.3 * turn)]
    )
    share = 0.5 - 0.5 * np.cos(np.pi * np.clip((time - 0.45 * seconds) / (0.1 * seconds), 0.0, 1.0))
    # Out over the edge and round it, in free space.
    away = np.sin(np.pi * share)[:, None] * [0.03, 0.03, 0.0]
    return time, (1.0 - share[:, None]) * over + share[:, None] * beside + away


def spring(hip):
    """The force on the hand, (n, 3), N: of a spring to the nearest point of the cube."""
    frame = CUBE.boundary.closest_point(hip)
    return STIFFNESS * np.maximum(-frame.distance, 0.0)[:, None] * frame.normal


def noise(shape, deviation, *, seed=SEED):
    return deviation * np.random.default_rng(seed).standard_normal(shape)


def rounded(values, step):
    return np.round(values / step) * step


def low_passed(values, share):
    out = np.array(values)
    for row in range(1, len(out)):
        out[row] = out[row - 1] + share * (values[row] - out[row - 1])
    return out


def late(values, rows):
    return np.concatenate([np.repeat(values[:1], rows, axis=0), values[: len(values) - rows]])


def recording(time, hip, force, **meta):
    return Recording(time, {"hip": hip, "force": force}, {"source": "file", **meta})


def log(*, seconds=6.0, rate=1000.0, speed=1.0, deviation=0.01, force_step=0.0, hip_step=0.0, share=1.0, lag=0):
    """A clean log by its sensors: noise and converter of the force, encoder of the hand, filter, and ticks of lag."""
    time, hip = path(seconds, rate, speed=speed)
    hip = rounded(hip, hip_step) if hip_step else hip
    force = low_passed(late(spring(hip), lag) + noise(hip.shape, deviation), share)
    return recording(time, hip, rounded(force, force_step) if force_step else force)


def free(deviation, **sensors):
    made = log(**sensors, deviation=0.0)
    hip = made.hip + 0.03 * (X + Y)
    return recording(made.time, hip, noise(hip.shape, deviation))


def rested():
    """A hand that lies still on the cube for the middle third."""
    time, hip = path()
    hip[2000:4000] = hip[2000]
    hip[4000:] += hip[2000] - path()[1][4000]
    return recording(time, rounded(hip, 1e-5), spring(hip) + noise(hip.shape, 0.01))


def digits():
    made = log(deviation=0.0)
    return recording(
        made.time, *(np.array([[float(f"{x:.6g}") for x in row] for row in v]) for v in (made.hip, made.force))
    )


CLEAN: dict[str, Callable[[], Recording]] = {
    "computed force, doubles": lambda: log(deviation=0.0),
    "computed force, six digits": digits,
    "computed force, encoders of 20 um": lambda: log(deviation=0.0, hip_step=2e-5),
    "sensor noise of 0.01 N": log,
    "sensor noise of 0.05 N": lambda: log(deviation=0.05),
    "noise of 0.02 N behind a low-pass of 100 Hz": lambda: log(deviation=0.02, share=0.47),
    "noise of 0.01 N, encoders of 50 um": lambda: log(hip_step=5e-5),
    "converter of 0.01 N": lambda: log(deviation=0.003, force_step=0.01),
    "converter of 0.05 N, hardly any noise": lambda: log(deviation=0.002, force_step=0.05),
    "converter of 0.05 N, slow hand": lambda: log(deviation=0.0, force_step=0.05, speed=0.25),
    "20 s at 1 kHz": lambda: log(seconds=20.0),
    "100 Hz": lambda: log(seconds=20.0, rate=100.0),
    "4 kHz, force 2 ticks late": lambda: log(rate=4000.0, lag=2),
    "fast hand": lambda: log(speed=3.0),
    "free motion, noise of 0.01 N": lambda: free(0.01),
    "free motion, noise of 0.05 N, encoders of 20 um": lambda: free(0.05, hip_step=2e-5),
    "a hand at rest in contact": rested,
}
"""Each is a log of a sound rig: nothing should be complained of, with the model or without it."""


def changed(hip=None, force=None, *, time=None, deviation=0.005, **meta):
    """A log with `hip`, `force` or `time` put through a function, the force made of the hand as it was."""
    t, x = path()
    f = spring(x) + noise(x.shape, deviation)
    keep = slice(None) if time is None else time(t)
    return recording(t[keep], (x if hip is None else hip(x))[keep], (f if force is None else force(f))[keep], **meta)


def over(rows, change):
    """A change of some rows of the x, y or z that it is given."""

    def planted(values):
        values = values.copy()
        values[rows] = change(values[rows])
        return values

    return planted


def held(values):
    return np.repeat(values[:1], len(values), axis=0)


def about(axis, degrees):
    cos, sin = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    turn = np.eye(3)
    first, second = [k for k in range(3) if k != axis]
    turn[first, first] = turn[second, second] = cos
    turn[first, second], turn[second, first] = -sin, sin
    return turn


def dropped(share):
    return lambda t: np.random.default_rng(SEED).random(t.size) > share


def slower(factor):
    return recording(*_with_time(lambda t: factor * t))


def _with_time(change):
    made = changed()
    return change(made.time), made.hip, made.force


def numbered(share):
    """5 % of the rows are dropped, and the mapping states the rate: the times close up over what is missing."""
    made = changed(time=dropped(share))
    return recording(1e-3 * np.arange(len(made)), made.hip, made.force)


MIDDLE = slice(1200, 1700)
"""Half a second of contact on the top."""

PLANTED: dict[str, Callable[[], Recording]] = {
    "force: lbf declared N": lambda: changed(force=lambda f: f / 4.4482216),
    "force: kgf declared N": lambda: changed(force=lambda f: f / 9.80665),
    "force: mN declared N": lambda: changed(force=lambda f: 1000.0 * f),
    "force: gain 1.2": lambda: changed(force=lambda f: 1.2 * f),
    "force: bias of 2 N, out of the model": lambda: changed(force=lambda f: f + 2.0 * Y),
    "force: bias of 4 N, into the model": lambda: changed(force=lambda f: f - 4.0 * Y),
    "force: bias of 0.3 N along the top": lambda: changed(force=lambda f: f + 0.3 * X),
    "force: drift of 1 N": lambda: changed(force=lambda f: f + np.linspace(0.0, 1.0, len(f))[:, None] * Y),
    "force: wrong sign": lambda: changed(force=lambda f: -f),
    "force: wrong sign of y": lambda: changed(force=lambda f: f * [1.0, -1.0, 1.0]),
    "force: x and y swapped": lambda: changed(force=lambda f: f[:, [1, 0, 2]]),
    "force: axes permuted": lambda: changed(force=lambda f: f[:, [2, 0, 1]]),
    "force: turned by 30 degrees": lambda: changed(force=lambda f: f @ about(2, 30.0).T),
    "force: 5 ms late": lambda: changed(force=lambda f: late(f, 5)),
    "force: 20 ms late": lambda: changed(force=lambda f: late(f, 20)),
    "force: low-pass of 3 Hz": lambda: changed(force=lambda f: low_passed(f, 0.019)),
    "force: stuck for 0.5 s": lambda: changed(force=over(MIDDLE, held)),
    "force: one axis gone": lambda: changed(force=lambda f: f * [1.0, 0.0, 1.0], deviation=0.0),
    "force: constant": lambda: changed(force=lambda f: np.tile([0.0, 0.7, 0.0], (len(f), 1))),
    "force: clipped at 1 N": lambda: changed(force=lambda f: np.clip(f, -1.0, 1.0), deviation=0.0),
    "force: spike of 5 N": lambda: changed(force=over(slice(1400, 1401), lambda f: f + 5.0)),
    "force: half-wave rectified wrongly": lambda: changed(force=lambda f: np.abs(f) * [-1.0, -1.0, 1.0]),
    "force: of another run": lambda: changed(force=lambda f: np.roll(f, 2500, axis=0)),
    "force: dead zone of 0.5 N": lambda: changed(force=lambda f: np.sign(f) * np.maximum(np.abs(f) - 0.5, 0.0)),
    "hand: mm declared m": lambda: changed(hip=lambda x: 1000.0 * x),
    "hand: cm declared m": lambda: changed(hip=lambda x: 100.0 * x),
    "hand: inches declared m": lambda: changed(hip=lambda x: x / 0.0254),
    "hand: x mirrored": lambda: changed(hip=lambda x: x * [-1.0, 1.0, 1.0]),
    "hand: y mirrored": lambda: changed(hip=lambda x: x * [1.0, -1.0, 1.0]),
    "hand: x and y swapped": lambda: changed(hip=lambda x: x[:, [1, 0, 2]]),
    "hand: y and z swapped": lambda: changed(hip=lambda x: x[:, [0, 2, 1]]),
    "hand: turned by 20 degrees": lambda: changed(hip=lambda x: x @ about(2, 20.0).T),
    "hand: 2 mm too high": lambda: changed(hip=lambda x: x + 0.002 * Y),
    "hand: 2 mm too low": lambda: changed(hip=lambda x: x - 0.002 * Y),
    "hand: 10 ms late": lambda: changed(hip=lambda x: late(x, 10)),
    "hand: scaled by 1.05": lambda: changed(hip=lambda x: 1.05 * x),
    "hand: stuck throughout": lambda: changed(hip=held),
    "hand: stuck for 4 s": lambda: changed(hip=over(slice(1000, 5000), held)),
    "hand: stuck for 0.3 s": lambda: changed(hip=over(slice(1300, 1600), held)),
    "hand: one axis stuck for 1 s": lambda: changed(
        hip=lambda x: np.column_stack([x[:, 0], over(slice(1000, 2000), held)(x[:, 1]), x[:, 2]])
    ),
    "hand: lost for 30 rows": lambda: changed(hip=over(slice(1400, 1430), lambda x: 0.0 * x)),
    "hand: spike of 20 mm": lambda: changed(hip=over(slice(1400, 1401), lambda x: x + 0.02)),
    "hand: a counter overflows": lambda: changed(hip=over(slice(1400, None), lambda x: x + 0.065536 * X)),
    "clock: a gap of 0.2 s": lambda: changed(time=lambda t: (t < 2.0) | (t > 2.2)),
    "clock: 5 % of the rows dropped": lambda: changed(time=dropped(0.05)),
    "clock: 5 % dropped at a stated rate": lambda: numbered(0.05),
    "clock: ms declared s": lambda: slower(1000.0),
}
"""One fault each."""

NAMED_AS: dict[str, str] = {
    "force: lbf declared N": "unit",
    "force: kgf declared N": "unit",
    "force: mN declared N": "unit",
    "force: gain 1.2": "gain",
    "force: bias of 2 N, out of the model": "bias",
    "force: bias of 4 N, into the model": "bias",
    "force: bias of 0.3 N along the top": "bias",
    "force: drift of 1 N": "drift",
    "force: wrong sign": "sign",
    "force: wrong sign of y": "axes",
    "force: x and y swapped": "axes",
    "force: axes permuted": "axes",
    "force: turned by 30 degrees": "rotation",
    "force: 5 ms late": "lag",
    "force: 20 ms late": "lag",
    "force: low-pass of 3 Hz": "low-pass",
    "force: one axis gone": "gain of an axis",
    "force: constant": "constant",
    "force: clipped at 1 N": "limit",
    # -|f| on both axes that are pressed: reversed. The rectified noise is a constant force of less than 1 %.
    "force: half-wave rectified wrongly": "sign",
    # 0.5 N at 500 N/m: a force that begins 1 mm inside.
    "force: dead zone of 0.5 N": "offset",
    "hand: mm declared m": "position unit",
    "hand: cm declared m": "position unit",
    "hand: inches declared m": "position unit",
    # On a cube a mirrored hand is a mirrored force.
    "hand: x mirrored": "axes",
    "hand: y mirrored": "axes",
    "hand: x and y swapped": "axes",
    "hand: y and z swapped": "axes",
    "hand: turned by 20 degrees": "position rotation",
    "hand: 2 mm too high": "position offset",
    "hand: 2 mm too low": "position offset",
    # A hand that is late has a force that is early.
    "hand: 10 ms late": "lag",
    "hand: scaled by 1.05": "position scale",
}
"""The cause that a diagnosis should name where the columns alone do not show it; of another run it knows nothing."""

SHOWN_BY_COLUMNS = {"stuck", "spike", "jump", "dropout", "gap", "dropped rows", "unit"}
"""Kinds of issues that are a cause themselves."""
