"""Documents of anyone: what is nested or counted beyond reason is refused in a sentence, before it is taken apart."""

import pytest

from hapticeval.documents import DEEPEST_NESTING, convert, parse_json, read_toml
from hapticeval.errors import InputError


@pytest.mark.parametrize(
    "text",
    [
        "a = " + "[" * 5000 + "]" * 5000,
        ".".join("a" * (DEEPEST_NESTING + 1)) + " = 1",
        "a = " + "1" * 5000,
        "a = \ud800".encode("utf-8", "surrogatepass"),
    ],
)
def test_toml_beyond_reason_is_refused(refused, tmp_path, text):
    file = tmp_path / "a.toml"
    file.write_bytes(text if isinstance(text, bytes) else text.encode())
    with refused(InputError):
        read_toml(file)


@pytest.mark.parametrize(
    "text",
    ["[" * 100_000, '{"a":' * (DEEPEST_NESTING + 1) + "1" + "}" * (DEEPEST_NESTING + 1), "1" * 5000, "{", b"\xff"],
)
def test_json_beyond_reason_is_refused(refused, text):
    with refused(InputError):
        parse_json(text, "the text")


def test_what_is_as_deep_as_allowed_is_read(tmp_path):
    file = tmp_path / "a.toml"
    file.write_text(".".join("a" * DEEPEST_NESTING) + " = 1")
    assert read_toml(file) == parse_json('{"a":' * DEEPEST_NESTING + "1" + "}" * DEEPEST_NESTING, "the text")


def test_a_number_that_no_float_holds_is_refused():
    with pytest.raises(InputError):
        convert(10**400, float, "a.toml")
