"""The command line as one types it: `hapticeval explain` leads from the field's words to the checks."""

import pytest

from hapticeval.cli import main
from hapticeval.commands.listing import explanation
from hapticeval.errors import InputError, UnknownNameError


@pytest.mark.parametrize(
    ("word", "check"),
    [
        ("continuous-contact", "continuous-contact"),
        ("pop-through", "continuous-contact"),
        ("Pop through", "continuous-contact"),
        ("fall-through", "contact-kept"),
        ("sinking", "centripetal-force"),
        ("kick", "force-magnitude"),
    ],
)
def test_a_word_of_one_check_explains_that_check(word, check):
    assert explanation(word).startswith(f"{check} ")


@pytest.mark.parametrize(
    ("word", "checks"),
    [
        ("jitter", ["contact-normal-force", "force-magnitude"]),
        ("sticking", ["broken-contact", "friction-sticking"]),
        # In the text of pages alone.
        ("god-object", ["continuous-contact", "memoryless"]),
    ],
)
def test_a_word_of_several_checks_lists_them_with_their_questions(word, checks):
    first, _, *rows = explanation(word).splitlines()
    assert f"{len(checks)} checks" in first
    assert [row.split()[0] for row in rows if not row.startswith(" ")] == checks


def test_an_unknown_word_suggests_names_and_words():
    with pytest.raises(UnknownNameError, match="unknown check 'tunneling'") as refused:
        explanation("tunneling")
    assert "tunnelling" in refused.value.todo


@pytest.mark.parametrize(
    ("word", "kind"), [("star-convex-corner", "cases"), ("dumbbell", "models"), ("parallelogram-2dof", "devices")]
)
def test_what_is_no_check_is_told_where_it_is_listed(word, kind):
    with pytest.raises(InputError, match=f"'{word}' is not a check") as refused:
        explanation(word)
    assert refused.value.todo == f"see hapticeval list {kind}"


def test_words_of_no_letters_are_unknown():
    with pytest.raises(UnknownNameError):
        explanation("-")


def test_a_selection_by_a_word_of_the_field_is_told_the_check(capsys):
    assert main(["run", "-r", "constraint", "-k", "pop-through"]) == 4
    assert "did you mean continuous-contact?" in capsys.readouterr().err


def test_a_word_of_the_field_is_not_taken_for_a_case_that_is_spelt_alike(capsys):
    assert main(["run", "effects-friction", "-r", "constraint", "-k", "stick-slip"]) == 4
    assert "did you mean friction-sticking?" in capsys.readouterr().err


def test_a_search_for_a_word_of_the_field_is_told_the_check(capsys):
    assert main(["search", "-r", "constraint", "--check", "pop-through"]) == 2
    assert "did you mean continuous-contact?" in capsys.readouterr().err


def test_several_words_need_no_quotes(capsys):
    assert main(["explain", "false", "friction"]) == 0
    assert capsys.readouterr().out.startswith("contact-normal-force ")
