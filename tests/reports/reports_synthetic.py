"""A result folder as a run leaves it, with hostile names in it: two models, every outcome, a renderer that broke."""

from __future__ import annotations

import numpy as np

from hapticeval.geometry.catalogue import make_model
from hapticeval.phenomena.verdict import Finding, Level, Metric, Outcome, Verdict
from hapticeval.recordings.recording import Recording
from hapticeval.runner.results import Results, file_stem, verdict_document

HOSTILE = "mine:<script>alert(1)</script>&'\""
GAIN = 1000.0
SCENE = {
    "stiffness": GAIN,
    "damping": 0.0,
    "mass": 0.1,
    "bilateral": False,
    "restitution": 0.0,
    "sampling_time": 1e-3,
}


def played(model, hips, **meta):
    """A minimum distance projection along `hips`, made without any renderer."""
    curve = model.curve
    ihips = np.where(curve.contains(hips)[:, None], curve.position(curve.nearest(hips)), hips)
    return Recording(
        np.arange(len(hips)) * 1e-3,
        {"hip": hips, "ihip": ihips, "force": GAIN * (ihips - hips)},
        {"source": "playback", "dt": 1e-3, **meta},
    )


def lobe_recording():
    """Deep through a lobe of the Cassinian: one jump between its flanks, at half time."""
    model = make_model("cassinian")
    return played(model, 0.7 * model.curve.position(np.linspace(-np.pi / 4, np.pi / 4, 2000)))


def tip_recording():
    """Under the tip of the star, from face to face."""
    x = np.linspace(-0.02, 0.02, 1500)
    hips = np.column_stack([x, 0.092 - np.sqrt(3.0) * np.abs(x)])
    return played(make_model("star"), hips, source="experiment")


def jump_tick(recording):
    return int(np.argmax(np.linalg.norm(np.diff(recording.ihip, axis=0), axis=1))) + 1


def run_document(case, renderer, kind, *, recording=True, error=None, stimulus="trajectory"):
    file = f"recordings/synthetic/{case}/{file_stem(renderer)}.h5"
    return {
        "suite": "synthetic",
        "case": case,
        "renderer": renderer,
        "recording": file if recording else None,
        "simulated_seconds": 2.0,
        "wall_seconds": 0.125,
        "stimulus": stimulus,
        "title": f"The {case} & its <edges>",
        "shows": "What a <b>jump</b> looks like.",
        "citation": "6.1.3",
        "model": {"kind": kind},
        "depth_of": "model",
        "judged": True,
        "scene": SCENE,
        "error": error,
    }


def verdicts(case, renderer, recording):
    tick = jump_tick(recording)
    evidence = {"time": float(recording.time[tick]), "tick": tick, "hip": list(recording.hip[tick])}
    jump = Finding(Outcome.FAIL, "pop-through <here>", Metric("IHIP jump", 0.04, "m"), 1e-3, evidence)
    switch = Finding(Outcome.PASS, "fine", Metric("angle", 0.25, "deg"), 1.0)
    slow = Finding(Outcome.INCONCLUSIVE, "too slow | to say", Metric("share", float("inf"), ""), 0.1)
    given = [
        ("continuous-contact", jump, Level.MUST, Outcome.FAIL),
        ("contact-normal-force", switch, Level.MUST, Outcome.FAIL),
        ("centripetal-force", slow, Level.SHOULD, None),
        ("memoryless", jump, Level.INFO, None),
        ("broken-contact", jump, Level.MUST, None),
        ("impulsive-collision", Finding(Outcome.NOT_APPLICABLE, "no collision"), Level.MUST, None),
    ]
    return [
        verdict_document(Verdict(renderer, "synthetic", case, check, level, finding, published))
        for check, finding, level, published in given
    ]


def synthetic_results(**changes) -> Results:
    """What `folder` holds."""
    broke = {"what": "it raised <ValueError> at tick 7", "why": "x < 0 \x1b[31m", "todo": "mend it"}
    recordings = {("lobe", "plain"): lobe_recording(), ("tip", HOSTILE): tip_recording()}
    given = [each for (case, name), recording in recordings.items() for each in verdicts(case, name, recording)]
    given.append(
        verdict_document(
            Verdict(
                "broken",
                "synthetic",
                "lobe",
                "continuous-contact",
                Level.MUST,
                Finding(Outcome.ERROR, f"{broke['what']} {broke['why']}"),
            )
        )
    )
    whole = {
        "planned": len(given),
        "ran": len(given),
        "complete": True,
        "reason": None,
        "environment": {"python": "3.11", "platform": "Linux", "cpu_count": 2, "versions": {"hapticeval": "0.1.0"}},
        "seed": 3,
        "command": {"suites": ["synthetic"], "select": None},
        "runs": [
            run_document("lobe", "plain", "cassinian"),
            run_document("lobe", "broken", "cassinian", recording=False, error=broke),
            run_document("tip", HOSTILE, "star", stimulus="experiment"),
            run_document("tip", "plain", "star", recording=False, error=broke),
        ],
        "verdicts": given,
        "table": {"Resists <Pop>": {"plain": "No", HOSTILE: "Yes"}, "Suitable for LUT": {"plain": "Yes"}},
        "published_table": {"Resists <Pop>": {"plain": "No", HOSTILE: "No"}},
        "timing": {"simulated_seconds": 8.0, "wall_seconds": 0.5, "times_real_time": 16.0},
    }
    return Results(**{**whole, **changes})
