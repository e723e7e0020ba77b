"""Where foreign code was caught: the line that its author can do something about."""

from __future__ import annotations

import sysconfig

import pytest

import hapticeval.errors
from hapticeval.cli import main
from hapticeval.errors import kind_of, place_in_stack, printable

OURS = hapticeval.errors.__file__
WAITS = f"{sysconfig.get_path('stdlib')}/threading.py"
LIBRARY = f"{sysconfig.get_path('purelib')}/numpy/linalg.py"


@pytest.mark.parametrize(
    ("files", "named"),
    [
        ((OURS, "/home/ann/mine.py"), "mine.py, line 1,"),
        ((OURS, "/home/ann/mine.py", "/home/ann/maths.py", WAITS), "maths.py, line 2,"),
        ((OURS, "/home/ann/mine.py", OURS, LIBRARY), "mine.py, line 1,"),
        ((OURS, "<frozen importlib>", WAITS, "/home/ann/mine.py"), "mine.py, line 3,"),
        ((OURS, LIBRARY, WAITS), "linalg.py, line 1,"),
        ((OURS, OURS, WAITS), "errors.py, line 1,"),
    ],
)
def test_the_line_of_the_foreign_code_is_named(files, named):
    assert place_in_stack([(file, at, "step") for at, file in enumerate(files)]).startswith(f"in {named} in step")


def test_no_stack_says_nothing():
    assert place_in_stack(()) == ""


def test_errors_are_of_one_kind_whatever_their_numbers():
    texts = ["it raised KeyError: 'a' at tick 3, HIP (0, 1) mm", "it raised KeyError: 'b' at tick 4, HIP (0, 2) mm"]
    assert {kind_of(text) for text in texts} == {"it raised KeyError"}


def test_what_others_wrote_cannot_steer_a_terminal():
    assert printable("a\tb\nc é°ß 点") == "a\tb\nc é°ß 点"
    assert printable("\x1b[2J\r\x9b1m\x00") == "\\x1b[2J\\r\\x9b1m\\x00"
    assert printable("txt.\u202eexe") == "txt.\\u202eexe"


def test_a_message_shows_control_characters_written_out(tmp_path, capsys):
    (tmp_path / "evil.toml").write_text('title = "a"\n"\\u001b[2Jgone" = 1\n')
    assert main(["run", str(tmp_path / "evil.toml")]) == 2
    told = capsys.readouterr().err
    assert "\x1b" not in told
    assert "\\x1b[2Jgone" in told
