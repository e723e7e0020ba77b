"""A result folder as a run leaves it, with hostile names in it: two models, every outcome, a renderer that broke."""

from __future__ import annotations

import numpy as np
from result_entries import changed, results_of, run_entry

from hapticeval.files import file_stem
from hapticeval.geometry.catalogue import make_model
from hapticeval.phenomena.verdict import Finding, Level, Metric, Outcome, Verdict
from hapticeval.recordings.recording import Recording
from hapticeval.runner.results import Problem, ResultsDocument, VerdictEntry

HOSTILE = "mine:<script>alert(1)</script>&'\""
GAIN = 1000.0
BROKE = Problem(what="it raised <ValueError> at tick 7", why="x < 0 \x1b[31m", todo="mend it")


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


def synthetic_run(case, renderer, kind, *, recording=True, **changes):
    file = f"recordings/synthetic/{case}/{file_stem(renderer)}.h5"
    given = {
        "suite": "synthetic",
        "case": case,
        "renderer": renderer,
        "recording": file if recording else None,
        "title": f"The {case} & its <edges>",
        "shows": "What a <b>jump</b> looks like.",
        "citation": "6.1.3",
        "model": {"kind": kind},
    }
    return run_entry(**{**given, **changes})


def verdict(case, renderer, check, finding, level=Level.MUST, published=None, suite="synthetic"):
    return VerdictEntry.of(Verdict(renderer, suite, case, check, level, finding, published))


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
    jump, *others = (verdict(case, renderer, *each) for each in given)
    return [changed(jump, known="a limit of the method", as_expected=True), *others]


def synthetic_results(*, strict: bool = False, **changes) -> ResultsDocument:
    """What `folder` holds."""
    recordings = {("lobe", "plain"): lobe_recording(), ("tip", HOSTILE): tip_recording()}
    given = [each for (case, name), recording in recordings.items() for each in verdicts(case, name, recording)]
    broken = Finding(Outcome.ERROR, f"{BROKE.what} {BROKE.why}")
    given.append(verdict("lobe", "broken", "continuous-contact", broken))
    runs = [
        synthetic_run("lobe", "plain", "cassinian"),
        synthetic_run("lobe", "broken", "cassinian", recording=False, error=BROKE),
        synthetic_run("tip", HOSTILE, "star", stimulus="experiment"),
        synthetic_run("tip", "plain", "star", recording=False, error=BROKE),
    ]
    whole = {
        "runs": runs,
        "verdicts": given,
        "table": {"Resists <Pop>": {"plain": "No", HOSTILE: "Yes"}, "Suitable for LUT": {"plain": "Yes"}},
        "published_table": {"Resists <Pop>": {"plain": "No", HOSTILE: "No"}},
        **changes,
    }
    shown = whole.pop("verdicts")
    return results_of(*shown, strict=strict, **whole)
