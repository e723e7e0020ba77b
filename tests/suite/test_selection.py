"""Expressions that select cases and checks, and the few cases of a quick run."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hapticeval.errors import HapticevalError, InputError, NothingSelectedError
from hapticeval.suite.outline import find_suites
from hapticeval.suite.reading import load_suite
from hapticeval.suite.selection import covering, select

THESIS = load_suite("thesis")
WHOLE = {(case.name, check) for case in THESIS.cases for check in case.checks}


def chosen(*expressions):
    return {(case.name, check) for _, case in select([THESIS], expressions) for check in case.checks}


def named(*parts):
    return {place for place in WHOLE if all(part in "/".join(place) for part in parts)}


@pytest.mark.parametrize(
    ("expression", "expected"),
    [
        ("plane-press", named("plane-press/")),
        ("star", named("star-")),
        ("star-*", named("star-")),
        ("memoryless", named("/memoryless")),
        ("*/memoryless", named("/memoryless")),
        ("thesis/star-*", named("star-")),
        ("star-convex-corner/memoryless or plane-press/reset-clears", named("plane-press/reset-clears")),
        ("thesis/plane-press/reset-clears", named("plane-press/reset-clears")),
        ("not star-*", WHOLE - named("star-")),
        ("star-* and not force-magnitude", named("star-") - named("force-magnitude")),
        ("not (star-* or cassinian-*) and passivity", named("ellipse-", "passivity") | named("plane-", "passivity")),
        ("plane or circle and centripetal-force", named("plane-") | named("circle-", "centripetal-force")),
        ("not not plane-press", named("plane-press/")),
    ],
)
def test_what_an_expression_selects(expression, expected):
    if "star-convex-corner/memoryless" in expression:
        with pytest.raises(NothingSelectedError):
            chosen(expression)
    else:
        assert chosen(expression) == expected


def test_several_are_joined():
    assert chosen("plane-press", "star-*") == chosen("plane-press or star-*")


GLOBS = st.sampled_from(["star-*", "plane-press", "*/force-magnitude", "memoryless", "thesis/cassinian-*", "*"])
EXPRESSIONS = st.recursive(
    GLOBS,
    lambda some: (
        some.map("not ({})".format)
        | st.builds("({}) and ({})".format, some, some)
        | st.builds("({}) or ({})".format, some, some)
    ),
)


@given(EXPRESSIONS)
def test_what_is_not_selected_is_what_not_selects(expression):
    def of(text):
        try:
            return chosen(text)
        except NothingSelectedError:
            return set()

    assert of(expression) == WHOLE - of(f"not ({expression})")


@pytest.mark.parametrize(
    "expression",
    [
        "plane-press/continuos-contact",
        "thesis/plane-press/continuos-contact",
        "plane-press/quux",
        "star-convx-corner",
        "star-convx-corner/memoryless",
        "not memoriless",
        "*xyz*",
        "impact*",
        "ess/contact-kept",
        "plane-press and star-*",
        "-slide*",  # a part of five names, of which three are told
    ],
)
def test_what_selects_nothing_is_refused_with_what_may_be_meant(refused, expression):
    with refused(NothingSelectedError):
        chosen(expression)


@pytest.mark.parametrize("expression", ["", "not", "star and", "and star", "(star", "star)", "star plane", "()"])
def test_what_is_no_expression_is_refused(refused, expression):
    with refused(InputError):
        chosen(expression)


@pytest.mark.parametrize(
    ("phrase", "check"),
    [
        ("too soft", "force-magnitude"),
        ("a kick", "force-magnitude"),
        ("jitter of the force", "force-magnitude"),
        ("jitter of the direction", "contact-normal-force"),
        ("drag", "contact-normal-force"),
    ],
)
def test_words_of_the_field_are_answered_with_the_check_that_they_are_for(phrase, check):
    """Its first word may select nothing, as `too`, or all, as `a`: it is the phrase that is known."""
    with pytest.raises(HapticevalError) as refusal:
        chosen(phrase)
    assert refusal.value.todo == f"did you mean {check}?"


@pytest.mark.parametrize("name", find_suites())
def test_a_quick_run_has_every_check_of_what_is_judged_in_few_cases(name):
    suite = load_suite(name)
    cases = select([suite], [])
    few = covering(cases)
    judged = [case for _, case in cases if case.judged] or [case for _, case in cases]
    assert {check for _, case in few for check in case.checks} == {check for case in judged for check in case.checks}
    assert all(case in suite.cases for _, case in few)
    for _, left in few:
        others = {check for _, case in few if case is not left for check in case.checks}
        assert set(left.checks) - others or len(few) == 1, "each case is there for a check"
