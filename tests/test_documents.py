"""Documents of anyone: what is nested or counted beyond reason is refused in a sentence, before it is taken apart."""

import os
import zipfile

import numpy as np
import pytest

from hapticeval import documents, files
from hapticeval.documents import DEEPEST_NESTING, LARGEST_TOML, convert, parse_json, read_toml
from hapticeval.errors import InputError
from hapticeval.recordings.formats.arrays import read_npz


@pytest.mark.parametrize(
    "text",
    [
        "a = " + "[" * 5000 + "]" * 5000,
        ".".join("a" * (DEEPEST_NESTING + 1)) + " = 1",
        "a." * 100_000 + "a = 1",
        "[" + "'a' . " * 100_000 + "a]",
        "a = " + "1" * 5000,
        "[a]\nb = [1, {c = " + "1" * 310 + "}]",
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
    [
        '{"a": [{"name": "q", "b": "\\ud800"}]}',
        '{"\\udfff": 1}',
        '{"a": ' + "9" * 310 + "}",
        "[" * 100_000,
        '{"a":' * (DEEPEST_NESTING + 1) + "1" + "}" * (DEEPEST_NESTING + 1),
        "1" * 5000,
        "{",
        b"\xff",
    ],
)
def test_json_beyond_reason_is_refused(refused, text):
    with refused(InputError):
        parse_json(text, "the text")


@pytest.mark.parametrize("text", ['{"b": ["\\ud800"]}', '{"b": ' + "9" * 310 + "}", "[" * 80 + "]" * 80])
def test_a_file_of_json_beyond_reason_is_refused(refused, tmp_path, text):
    file = tmp_path / "a.json"
    file.write_text(text)
    with refused(InputError):
        files.parse_json(file, todo="mend it")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="the system has no named pipes")
def test_what_is_no_file_or_too_large_is_refused_before_it_is_read(refused, tmp_path):
    pipe, sparse = tmp_path / "pipe.toml", tmp_path / "sparse.toml"
    os.mkfifo(pipe)
    with sparse.open("wb") as file:
        file.truncate(LARGEST_TOML + 1)
    for path in (pipe, sparse, tmp_path, tmp_path / ("x" * 5000)):
        with refused(InputError):
            read_toml(path)
    with refused(InputError):
        files.parse_json(pipe, todo="")
    with refused(InputError):
        files.file_below(tmp_path, "x" * 5000)


def test_a_lack_of_memory_is_told_in_words(refused, tmp_path, monkeypatch):
    def fails(_text):
        raise MemoryError

    monkeypatch.setattr(documents.tomllib, "loads", fails)
    (tmp_path / "a.toml").write_text("a = 1")
    with refused(InputError):
        read_toml(tmp_path / "a.toml")


@pytest.mark.filterwarnings("ignore:Duplicate name")
def test_an_archive_with_two_arrays_of_one_name_is_refused(refused, tmp_path):
    file = tmp_path / "dup.npz"
    np.savez(file, t=np.arange(3.0))
    with zipfile.ZipFile(file, "a") as archive:
        archive.writestr("t.npy", archive.read("t.npy"))
    with refused(InputError):
        read_npz(file)


def test_what_is_as_deep_as_allowed_is_read(tmp_path):
    file = tmp_path / "a.toml"
    file.write_text(".".join("a" * DEEPEST_NESTING) + " = 1")
    assert read_toml(file) == parse_json('{"a":' * DEEPEST_NESTING + "1" + "}" * DEEPEST_NESTING, "the text")


@pytest.mark.parametrize(
    "text", ["a" * 4000 + " = 1", "a = '" + "x." * 4000 + "'", "a = " + "[1.5, 2.5]", 'a."b.c".d = 1']
)
def test_long_words_and_many_dots_are_no_depth(tmp_path, text):
    file = tmp_path / "a.toml"
    file.write_text(text)
    assert read_toml(file)


def test_a_number_that_no_float_holds_is_refused():
    with pytest.raises(InputError):
        convert(10**400, float, "a.toml")
