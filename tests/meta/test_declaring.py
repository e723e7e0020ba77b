"""Declaring more never makes a verdict worse: a standoff, a resolution, a range of stiffness, a resolution of force."""

from __future__ import annotations

from functools import cache

import force_sizes
import honest
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from latecomers import LateTool, late
from made import changed, found
from outsiders import CASES

from hapticeval.discovery import resolve
from hapticeval.geometry.catalogue import line, make_model
from hapticeval.phenomena.verdict import Finding, Level, Outcome
from hapticeval.recordings.recording import Recording
from hapticeval.scene import Scene
from hapticeval.simulation.playback import play
from hapticeval.stimulus.stimulus import Path

RENDERERS = {
    "spring": honest.Spring,
    "standoff": honest.factory("standoff", honest.Spring),
    "sunk": honest.factory("sunk", honest.Spring),
    "late-tool": late(kind=LateTool, ihip=3.0),
    "late-3": honest.factory("late-3", honest.Spring),
    "force-only": honest.factory("force-only", honest.Spring),
    "constraint": resolve("constraint"),
    "coarse": lambda scene: force_sizes.Coarse(scene, declared=False),
    **{name: force_sizes.faulty(name) for name in ("half", "kick", "dead-band", "by-place")},
}
SCENES = {
    "circle": (Scene(model=make_model(kind="circle")), None),
    "square": (
        Scene(model=make_model(kind="polygon", vertices=[[0.0, 0.0], [0.1, 0.0], [0.1, 0.1], [0.0, 0.1]])),
        Path(
            np.linspace(0.0, 0.5, 6),
            [[0.05, 0.103], [0.05, 0.098], [0.0995, 0.098], [0.0985, 0.05], [0.0999, 0.04], [0.11, 0.04]],
        ),
    ),
    "line": (
        Scene(model=line()),
        Path([0.0, 0.1, 0.3, 0.4, 0.5], [[-0.02, 2e-3], [-0.01, -3e-3], [0.01, -5e-5], [0.02, -2e-3], [0.02, 3e-3]]),
    ),
}


@cache
def led(renderer: str, scene: str) -> Recording:
    where, path = SCENES[scene]
    path = path or CASES["slide"].build_stimulus(where, None)
    return play(RENDERERS[renderer](where), path, 1e-3, scene=where)


def rank(finding: Finding, level: Level) -> int:
    """0 for what passes or is not asked, then what is undecided, and what fails: worse by its level."""
    if finding.outcome is Outcome.FAIL:
        return 3 if (finding.level or level) is Level.MUST else 2
    return 1 if finding.outcome is Outcome.INCONCLUSIVE else 0


LEVELS = {"force-magnitude": Level.SHOULD, "contact-normal-force": Level.MUST}
lengths = st.one_of(st.just(0.0), st.floats(1e-7, 5e-3), st.sampled_from([1e-4]))


renderers, scenes = st.sampled_from(sorted(RENDERERS)), st.sampled_from(sorted(SCENES))


@pytest.mark.parametrize("check", LEVELS)
@settings(max_examples=40)
@given(renderer=renderers, scene=scenes, standoff=lengths, resolution=lengths)
def test_a_standoff_and_a_resolution_make_no_verdict_worse(check, renderer, scene, standoff, resolution):
    recording = led(renderer, scene)
    bare, declared = (
        found(check, changed(recording, meta), SCENES[scene][0])
        for meta in ({"standoff": 0.0, "resolution": 0.0}, {"standoff": standoff, "resolution": resolution})
    )
    assert rank(declared, LEVELS[check]) <= rank(bare, LEVELS[check]), f"{bare.message} / {declared.message}"


@settings(max_examples=40)
@given(
    renderer=renderers,
    scene=scenes,
    quantum=st.floats(0.0, 1.0),
    least=st.floats(0.01, 0.55),
    largest=st.floats(1.8, 5.0),
)
def test_a_coarse_force_and_a_wide_range_of_stiffness_make_no_verdict_worse(renderer, scene, quantum, least, largest):
    """A range within a factor of two promises more than is asked of everybody, and may be broken."""
    recording = led(renderer, scene)
    said = {"force_resolution": quantum}, {"stiffness_least": least, "stiffness_largest": largest}
    bare = found("force-magnitude", recording, SCENES[scene][0])
    for meta in said:
        declared = found("force-magnitude", changed(recording, meta), SCENES[scene][0])
        assert rank(declared, Level.SHOULD) <= rank(bare, Level.SHOULD), f"{bare.message} / {declared.message}"


@pytest.mark.parametrize("standoff", [1e-4, 1e-3])
def test_a_tool_that_stands_off_may_be_pulled_from_the_surface(standoff):
    """Its force is the stiffness times the depth under the model, and the tool that it shows is farther out by that."""
    scene = SCENES["line"][0]
    recording = led("spring", "line")
    shifted = np.where(recording.apart[:, np.newaxis], recording.ihip + np.array([0.0, standoff]), recording.ihip)
    said, unsaid = (
        found("force-magnitude", changed(recording, meta, ihip=shifted), scene)
        for meta in ({"standoff": standoff}, {"standoff": 0.0})
    )
    assert (said.outcome, unsaid.outcome) == (Outcome.PASS, Outcome.FAIL), said.message
