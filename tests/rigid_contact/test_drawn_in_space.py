"""What `fuzz.py` draws without end in space: a small share of it, the same in each run, and the oracle that it asks."""

import math

import numpy as np
import pytest
from fuzz import judge_drawn
from medial_axis import allowed_jumps, worst_crossing

from hapticeval.geometry.catalogue import make_model
from hapticeval.phenomena.decisions import HALF_LAG_STEPS
from hapticeval.phenomena.measures.jumps import step_bounds
from hapticeval.phenomena.observed import Observed
from hapticeval.phenomena.sampling import rounding
from hapticeval.recordings.recording import Recording
from hapticeval.scene import Scene


@pytest.mark.system
@pytest.mark.parametrize("entry", ["ideal-in-space", "constraint-in-space", "medial-axis", "agreement-in-space"])
def test_in_what_a_search_draws_first_nothing_fails(entry, capsys):
    assert judge_drawn(entry, 3, 40) == 0, capsys.readouterr().out


def straight(start, end, ticks=200):
    return np.linspace(start, end, ticks)


def test_under_two_faces_of_a_cube_the_nearest_point_jumps_by_the_diagonal_of_the_depth():
    """From 5 mm under the top to 5 mm under the side, through a tie at 10 mm under both."""
    crossing = worst_crossing(make_model("cube").boundary, straight([0.035, 0.0, 0.045], [0.045, 0.0, 0.035]))
    assert crossing.jump == pytest.approx(0.01 * math.sqrt(2.0), abs=1e-9)
    assert crossing.allowed == pytest.approx(1.5 * 0.01 * math.sqrt(2.0) / 199)
    assert crossing.decided
    beside = worst_crossing(make_model("cube").boundary, straight([0.0, 0.0, 0.045], [0.03, 0.0, 0.045]))
    assert beside.jump == 0.0
    assert worst_crossing(make_model("cube").boundary, straight([0.0, 0.0, 0.06], [0.03, 0.0, 0.06])) is None


def test_inside_of_a_concave_edge_the_nearest_point_goes_over_without_a_jump():
    """Round the notch of an L, 5 mm under it: faces, edge and faces again follow the hand."""
    notch = np.array([-0.01, -0.01, 0.0])
    path = np.vstack(
        [straight([0.02, -0.005, 0], [-0.005, -0.005, 0]), straight([-0.005, -0.005, 0], [-0.005, 0.02, 0])]
    )
    crossing = worst_crossing(make_model("l-block").boundary, path + 2.0 * notch)
    assert crossing.jump == 0.0


def test_through_the_disc_of_an_ellipsoid_the_nearest_point_jumps_by_twice_its_height():
    """At its middle from one tip of the shortest axis to the other."""
    model = make_model("ellipsoid", a=0.1, b=0.07, c=0.05)
    through = worst_crossing(model.boundary, straight([1e-9, 1e-9, -0.003], [1e-9, 1e-9, 0.002]))
    assert through.jump == pytest.approx(0.1, abs=1e-6)
    # outside of the disc, whose half axis is a (1 - c^2 / a^2)
    past = worst_crossing(model.boundary, straight([0.076, 1e-9, -0.003], [0.076, 1e-9, 0.002]))
    assert past.jump == 0.0


def test_what_is_allowed_is_what_the_check_allows():
    """Written twice, and from the same sentence: the checks' own is in closed form, by a running maximum."""
    scene = Scene(model=make_model("cube"))
    random = np.random.default_rng(7)
    hips = np.cumsum(1e-3 * random.normal(size=(60, 3)) * random.choice([0.0, 1.0, 5.0], size=(60, 1)), axis=0)
    recording = Recording(np.arange(60) / 1e3, {"hip": hips, "ihip": hips})
    bounds = step_bounds(Observed(recording, scene), HALF_LAG_STEPS, 0.0)
    np.testing.assert_allclose(bounds, np.maximum(allowed_jumps(hips), rounding(scene)))
