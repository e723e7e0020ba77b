"""Cases in which renderers of `test_verdicts.py` are asked, beside those of suites and of `outsiders.py`."""

from __future__ import annotations

import numpy as np
from outsiders import case

from hapticeval.suite.case import Case

ARC = case(
    "arc",
    {"kind": "circle"},
    ("continuous-contact",),
    trajectory={
        "kind": "points",
        "points": (0.09 * np.exp(1j * np.radians(np.linspace(60.0, 77.0, 2000)))[:, None].view(float)).tolist(),
        "duration": 0.42,
    },
)
"""10 mm under a circle, 30 mm far along it: so deep, a map may take the contact point 100 mm aside."""

FAST_AND_SLOW = case(
    "fast-and-slow",
    {"kind": "line"},
    ("continuous-contact",),
    trajectory={
        "kind": "moves",
        "start": [-0.4, 0.01],
        "moves": [
            {"to": to, "seconds": seconds, "even": True}
            for to, seconds in (
                ([-0.3, -0.002], 0.1),
                ([-0.1, -0.002], 0.2),
                ([-0.09, -0.002], 1.0),
                ([0.11, -0.002], 0.2),
                ([0.11, -0.002], 0.1),
                ([0.31, -0.002], 0.2),
                ([0.41, 0.01], 0.2),
            )
        ],
    },
)
"""Under a line at 1 m/s, then for a second at 10 mm/s, on at 1 m/s, a rest, and on at 1 m/s."""

TO_THE_CENTRE = case(
    "to-the-centre",
    {"kind": "circle"},
    ("continuous-contact",),
    trajectory={"kind": "points", "points": [[0.0, 0.001], [0.0, 0.0]], "duration": 0.02},
)


def beside_the_centre(kind: str) -> Case:
    """Through a model a micrometre beside its centre: a conformal map takes the contact point half round it there."""
    along, across = np.array([[np.cos(0.3), np.sin(0.3)], [-np.sin(0.3), np.cos(0.3)]])
    points = (1e-6 * across + np.outer([-0.08, 0.08], along)).tolist()
    path = {"kind": "points", "points": points, "duration": 0.4}
    return case(f"beside-{kind}", {"kind": kind, "size": 0.1}, ("continuous-contact",), trajectory=path)


GRAZING = case(
    "grazing",
    {"kind": "cylinder", "size": 0.2, "length": 0.05, "sides": 6},
    ("impulsive-collision",),
    scene={"stiffness": 4000.0, "mass": 0.3},
    experiment={
        "position": [-0.08376410213776271, -0.02812140000389391, -0.021507985450097335],
        "velocity": [0.2, -0.3464, 0.0],
        "force": [[0.0, -0.25, 0.433, 0.0]],
        "duration": 0.05,
    },
)
"""Along a face, into it at 5 um/s: at 40 nm, where contact begins to count, 0.16 mN press already."""

SLIDING_OFF = case(
    "sliding-off",
    {"kind": "l-block", "size": 0.1, "thickness": 0.04, "length": 0.1},
    ("impulsive-collision",),
    scene={"mass": 0.3, "stiffness": 200.0},
    experiment={
        "position": [0.016, -0.0275, -0.052],
        "velocity": [-0.64, 0.0, 0.18],
        "force": [[0.0, -0.5, 0.0, 4.0], [0.4, -2.0, 0.0, 3.5]],
        "duration": 0.4,
    },
)
"""A tool flies into the end of an L, and slides off it before a soft spring has stopped it."""

BALL_OF_2_CM = case(
    "ball",
    {"kind": "icosphere", "size": 0.02, "subdivisions": 3},
    ("numerical-stability", "contact-kept"),
    trajectory={"kind": "points", "points": [[-0.006, 0.001, 0.01], [0.006, 0.002, 0.008]], "duration": 0.1},
)
