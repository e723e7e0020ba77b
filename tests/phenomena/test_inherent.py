"""Which failures follow from a declaration, number by number, and what of a declaration is kept and explained."""

from __future__ import annotations

import honest
import pytest
from honest import declaring
from made import FAIL

from hapticeval import Declaration, Spring
from hapticeval.geometry.catalogue import line
from hapticeval.phenomena.decisions import IMPULSE_ROUNDING
from hapticeval.phenomena.inherent import LIMITS, Region, declaration_words, limits_of, reason_inherent
from hapticeval.phenomena.registry import CHECKS
from hapticeval.phenomena.verdict import Finding, Metric, Outcome
from hapticeval.scene import Scene

SPRING = {"spring": "error"}
MEMORYLESS = {"memory": "none"}


def is_inherent(check, declared, *, value=1.0, bound=0.1, outcome=FAIL, **evidence):
    finding = Finding(outcome, "it fails", Metric("how far", value, "m"), bound, evidence)
    return bool(reason_inherent(check, finding, declared))


@pytest.mark.parametrize(
    ("impulse", "spring", "expected"),
    [
        (-0.01, None, False),
        (0.0, None, True),
        (1.0, None, True),
        (1.01, None, False),
        (1.0, 0.5, True),
        (1.2 * (1.0 + 0.9 * IMPULSE_ROUNDING), 1.2, True),
        (1.2 * (1.0 + 2.0 * IMPULSE_ROUNDING), 1.2, False),
    ],
)
def test_a_spring_takes_a_momentum_of_1_N_s_by_and_by_and_no_more_than_its_depths_make(impulse, spring, expected):
    more = {} if spring is None else {"spring_impulse_Ns": spring}
    numbers = {"impulse_in_window_Ns": impulse, "impulse_wanted_Ns": 1.0, **more}
    assert is_inherent("impulsive-collision", SPRING, **numbers, stopped_after_ms=3.0) is expected
    assert not is_inherent("impulsive-collision", SPRING, **numbers), "it is never stopped"
    assert not is_inherent("impulsive-collision", {}, **numbers, stopped_after_ms=3.0), "no spring is declared"
    assert not is_inherent("impulsive-collision", SPRING, impulse_in_window_Ns=impulse, stopped_after_ms=3.0)


@pytest.mark.parametrize(
    ("value", "softest", "expected"), [(1.09, 1.0, True), (1.11, 1.0, False), (2.09, 0.5, True), (2.11, 0.5, False)]
)
def test_a_spring_sinks_by_the_centripetal_force_over_its_least_stiffness(value, softest, expected):
    declared = {**SPRING, "stiffness_least": softest}
    assert is_inherent("centripetal-force", declared, value=value) is expected
    if softest == 1.0:
        assert is_inherent("centripetal-force", SPRING, value=value) is expected
    assert not is_inherent("centripetal-force", declared, value=value, force_over_spring=3.0)
    assert not is_inherent("centripetal-force", {"stiffness_least": softest}, value=value)


def test_a_spring_along_the_error_turns_with_the_hand_in_a_corner():
    assert is_inherent("abrupt-switch", SPRING)
    assert not is_inherent("abrupt-switch", {"spring": "normal"})
    for outcome in set(Outcome) - {FAIL}:
        assert not is_inherent("abrupt-switch", SPRING, outcome=outcome)
    assert not is_inherent("abrupt-switch", SPRING, ended={}), "no theorem makes a loop run away"


@pytest.mark.parametrize(("value", "expected"), [(1.09e-3, True), (1.11e-3, False)])
def test_without_memory_the_point_jumps_as_far_as_the_nearest_one_does(value, expected):
    numbers = {"value": value, "bound": 1e-4, "nearest_jump_m": 1e-3}
    assert is_inherent("continuous-contact", MEMORYLESS, **numbers, region="medial axis") is expected
    for elsewhere in set(Region) - {Region.MEDIAL}:
        assert not is_inherent("continuous-contact", MEMORYLESS, **numbers, region=elsewhere)
    assert not any(is_inherent(check, {}, **numbers, region="medial axis") for check in CHECKS)
    for other in ("off_surface_m", "unexplained_jump_m"):
        assert not is_inherent("continuous-contact", MEMORYLESS, **numbers, region="medial axis", **{other: 1.0})


@pytest.mark.parametrize(
    ("deepest", "region", "expected"),
    [(0.0, "surface", True), (1e-3, "surface", False), (1e-3, "medial axis", True), (1.0, "surface", False)],
)
def test_without_memory_a_hand_that_has_come_through_belongs_to_the_other_side(deepest, region, expected):
    numbers = {"deepest_m": deepest, "region": region}
    assert is_inherent("contact-kept", MEMORYLESS, kind="tunnelled", **numbers) is expected
    assert not is_inherent("contact-kept", MEMORYLESS, kind="let go", **numbers)
    assert not is_inherent("contact-kept", {}, kind="tunnelled", **numbers)


def test_a_declaration_is_kept_with_the_recording():
    made = declaring(honest.Spring, spring=Spring.ERROR, memoryless=True)(Scene(model=line()))
    assert made.declares.meta["memory"] == "none"
    assert Declaration(smooth_only=True).meta["surfaces"] == "smooth"
    assert Declaration(closed_form="pp").meta["closed_form"] == "pp"
    assert Declaration(memoryless="yes").faults


@pytest.mark.parametrize("limit", LIMITS, ids=lambda limit: limit.declared)
def test_each_limit_names_checks_and_its_source_and_explain_declares_it_in_python(limit):
    assert limit.checks <= CHECKS.keys()
    assert "thesis" in limit.because
    names = {"Declaration": Declaration, "Spring": Spring}
    exec(declaration_words(limit.declared).split(", or")[0], names)
    assert names["declares"] != Declaration()
    assert not names["declares"].faults


def test_a_check_has_the_limits_that_name_it_and_others_have_none():
    for check in CHECKS:
        named = {limit.declared for limit in LIMITS if check in limit.checks}
        assert set(limits_of(check)) == named
    assert limits_of("reset-clears") == {}
    assert "closed_form pp, pp-v, pp-d, pp-pd, pp-pd-c" in limits_of("decoupling")
