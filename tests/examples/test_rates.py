"""What a faster loop buys: metrics at each rate, what is left out, and the limit that grows with the rate."""

import pytest

from hapticeval.examples.studies import rates
from hapticeval.examples.studies.rates import study_rates, write_rates


@pytest.fixture(autouse=True)
def corners(monkeypatch):
    """Only the phenomena at corners: their paths are short."""
    monkeypatch.setattr(rates, "CASES", {name: rates.CASES[name] for name in ("broken-contact", "abrupt-switch")})


@pytest.mark.system
def test_a_faster_loop_buys_stiffness_and_no_phenomenon(tmp_path):
    document = study_rates(["constraint", "minimum-distance"], [1e3, 2e3], lambda *_: None)
    outcomes = {(row["renderer"], row["check"], row["outcome"]) for row in document["rows"]}
    assert outcomes == {
        ("constraint", "broken-contact", "pass"),
        ("constraint", "abrupt-switch", "fail"),
        ("minimum-distance", "broken-contact", "fail"),
        ("minimum-distance", "abrupt-switch", "fail"),
    }
    slow, fast = document["limit"]["rows"]
    assert fast["passive"] == pytest.approx(2.0 * slow["passive"])  # (2.40) without damping of its own: 2 b / T
    assert fast["stable"] == pytest.approx(2.0 * slow["stable"], rel=1e-3)
    assert {path.suffix for path in write_rates(tmp_path, document)} == {".svg", ".png", ".json"}


def test_a_rate_that_would_take_too_long_is_left_out(monkeypatch):
    assert rates._expected_seconds([(1e3, 1.0), (3e3, 3.0)], 1e4) == pytest.approx(10.0)
    monkeypatch.setattr(rates, "LONGEST_RUN", -1.0)
    document = study_rates(["constraint"], [1e3], lambda *_: None)
    assert all("it would take" in row["left_out"] for row in document["rows"])


def test_a_renderer_that_refuses_a_case_has_its_reason():
    document = study_rates(["set-stabilisation"], [1e3, 2e3], lambda *_: None)
    assert [row["outcome"] for row in document["rows"]] == ["not-applicable"] * 2
    assert all("corner" in row["message"] for row in document["rows"])
