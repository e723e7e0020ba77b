"""Each fault that users report says where, and has its case; the kill matrix has what names it."""

from __future__ import annotations

from asked import Row, hold
from field_bugs import BROKEN, CASES, HONEST
from honest import Spring

from hapticeval.geometry.catalogue import sphere


def test_every_fault_says_where_it_was_reported_and_every_case_has_a_fault():
    assert all(outsider.reported for outsider in BROKEN.values())
    assert len(BROKEN) >= 18
    assert len(HONEST) >= 9
    asked = {case for outsider in (*BROKEN.values(), *HONEST.values()) for case in outsider.cases}
    assert {name for name, case in CASES.items() if "update-rate" in case.checks} <= asked


def test_a_spring_answers_alike_however_its_faces_are_cut():
    hold(Row(Spring, CASES["normal-equal"]))
    assert sphere().cut() is None
