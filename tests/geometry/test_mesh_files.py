"""Meshes from files: the same solid from every format and unit, and a clear error for everything else."""

from __future__ import annotations

import struct
from contextlib import suppress

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from hapticeval.commands.arguments import model_named
from hapticeval.errors import InputError
from hapticeval.geometry import mesh_input
from hapticeval.geometry.catalogue import make_model
from hapticeval.geometry.mesh import Mesh
from hapticeval.suite.reading import load_suite

BLOCK = make_model("l-block", size=0.125, thickness=0.0625, length=0.5).boundary


@pytest.fixture
def written(tmp_path):
    def write(name, scale=1e3, **options):
        file = tmp_path / name
        trimesh.Trimesh(scale * BLOCK.vertices, BLOCK.triangles, process=False).export(file, **options)
        return file

    return write


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("a.stl", {}),
        ("b.STL", {"file_type": "stl_ascii"}),
        ("c.obj", {}),
        ("d.ply", {}),
        ("e.ply", {"encoding": "ascii"}),
        ("f.off", {}),
    ],
)
@pytest.mark.parametrize(("unit", "scale"), [("mm", 1e3), ("m", 1.0), ("cm", 1e2)])
def test_a_solid_is_the_same_from_every_format_and_in_every_unit(written, name, options, unit, scale):
    model = make_model("mesh", file=str(written(name, scale, **options)), unit=unit)
    assert isinstance(model.boundary, Mesh)
    assert len(model.boundary.triangles) == len(BLOCK.triangles)
    assert len(model.boundary.vertices) == len(BLOCK.vertices)
    points = np.random.default_rng(1).uniform(-0.3, 0.3, (500, 3))
    np.testing.assert_allclose(model.boundary.signed_distance(points), BLOCK.signed_distance(points), atol=1e-8)
    assert dict(model.parameters)["unit"] == unit


def test_an_inch_is_25_4_mm(written):
    model = make_model("mesh", file=str(written("a.off", 1.0 / 0.0254)), unit="in")
    assert model.size == pytest.approx(0.5, rel=1e-7)


def broken(kind, content):
    return pytest.param(f"a.{kind}", content, id=f"{kind}: {content[:24]!r}")


@pytest.mark.parametrize(
    ("name", "content"),
    [
        broken("stl", b""),
        broken("stl", b"solid\nfacet normal 0 0 0\nouter loop\nvertex a b c\n"),
        broken("stl", bytes(80) + struct.pack("<I", 4_000_000_000) + bytes(50)),
        broken("stl", bytes(range(256)) * 7),
        broken("obj", b"v 0 0 0\nf 1 2 3\n"),
        broken("obj", b"mtllib /etc/passwd\nv 0 0 0\n"),
        broken("obj", bytes(range(256)) * 7),
        broken("obj", b"v 0 0 0\nv 1 0 nan\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"),
        broken("ply", b"ply\nformat ascii 1.0\nelement vertex 999999999999\nproperty float x\nend_header\n1\n"),
        broken(
            "ply", b"ply\nformat binary_little_endian 1.0\nelement vertex 9999999999\nproperty float x\nend_header\n"
        ),
        broken("ply", b"not a ply"),
        broken("off", b"OFF\n4 4\n"),
        broken("off", b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 9\n"),
        broken("off", b"\x93NUMPY" * 9),
    ],
)
def test_damaged_files_are_refused_by_name(refused, tmp_path, name, content):
    (tmp_path / name).write_bytes(content)
    with refused(InputError):
        make_model("mesh", file=str(tmp_path / name), unit="mm")


@pytest.mark.parametrize(("limit", "least"), [("LARGEST_FILE", 100), ("MOST_TRIANGLES", 3)])
def test_a_file_that_is_too_large_is_refused(refused, written, monkeypatch, limit, least):
    monkeypatch.setattr(mesh_input, limit, least)
    with refused(InputError):
        make_model("mesh", file=str(written("a.stl")), unit="mm")


def test_a_cut_file_is_refused(refused, written):
    file = written("a.stl")
    file.write_bytes(file.read_bytes()[:-75])
    with refused(InputError):
        make_model("mesh", file=str(file), unit="mm")


def test_the_reason_is_one_of_the_file(refused, tmp_path, written):
    """Not one of the parser's: a cut STL was refused with "No module named 'charset_normalizer'"."""
    binary, words = (
        written(name, **more).read_bytes() for name, more in (("a.stl", {}), ("b.ply", {"encoding": "ascii"}))
    )
    text = written("c.stl", file_type="stl_ascii").read_bytes()
    last = words.rstrip().rindex(b"\n")
    for name, content in (
        ("a.stl", binary[:-75]),
        ("a.stl", binary[:50]),
        ("c.stl", text[:500]),
        ("a.stl", b""),
        ("a.obj", b""),
        ("a.ply", b""),
        ("a.off", b""),
        ("b.ply", words[:last] + b"\n3 0 1 99\n"),
        ("b.ply", words[:last] + b"\n3 0 1 -9\n"),
    ):
        (tmp_path / name).write_bytes(content)
        with refused(InputError):
            make_model("mesh", file=str(tmp_path / name), unit="mm")


def test_a_file_with_a_comment_in_latin_1_is_read(tmp_path, written):
    file = written("a.obj")
    file.write_bytes("# Prüfkörper\n".encode("latin-1") + file.read_bytes())
    assert len(make_model("mesh", file=str(file), unit="mm").boundary.triangles) == len(BLOCK.triangles)


def test_a_t_junction_is_open_and_told_how_to_close(refused):
    corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0.5, 0, 0]]
    divided = [[0, 2, 4], [4, 2, 1], [0, 4, 3], [4, 1, 3], [1, 2, 3], [0, 3, 2]]
    make_model("mesh", vertices=corners, triangles=divided)
    with refused(InputError) as caught:
        make_model("mesh", vertices=corners, triangles=[*divided[:2], [0, 1, 3], *divided[4:]])
    assert "a T-junction" in caught.value.todo
    with refused(InputError):
        make_model("mesh", vertices=corners, triangles=divided[:-1])


def test_other_files_are_refused(refused, tmp_path, written):
    with refused(InputError):
        make_model("mesh", file=str(tmp_path / "gone.stl"), unit="mm")
    with refused(InputError):
        make_model("mesh", file=str(tmp_path / "a.npy"), unit="mm")
    with refused(InputError):
        make_model("mesh", file=str(written("a.stl")))
    with refused(InputError):
        make_model("mesh", file=str(written("a.stl")), unit="ft")


def test_a_mesh_is_named_on_the_command_line_with_its_unit(refused, written):
    file = written("part.stl")
    assert model_named(f"mesh:file={file},unit=mm").size == pytest.approx(0.5)
    with refused(InputError) as caught:
        model_named(str(file))
    assert f"mesh:file={file},unit=mm" in caught.value.todo
    with refused(InputError):
        model_named('{"type": "Polygon", ' + 9999 * " ")  # a document in place of its file, longer than a name may be


SUITE = """
title = "A part"
[[case]]
name = "press"
title = "Press a part"
model = {{ kind = "mesh", file = "{file}", unit = "mm" }}
checks = ["contact-kept"]
[case.trajectory]
kind = "points"
points = [[0.0, -0.1, 0.0], [0.0, -0.05, 0.0]]
duration = 0.1
"""


def test_in_a_suite_a_file_counts_from_the_suite_and_lies_below_it(refused, tmp_path, written):
    (tmp_path / "parts").mkdir()
    written("parts/part.stl")
    (tmp_path / "mine.toml").write_text(SUITE.format(file="parts/part.stl"))
    case = load_suite(str(tmp_path / "mine.toml")).cases[0]
    assert case.build_scene().model.size == pytest.approx(0.5)
    assert make_model(**case.model).size == pytest.approx(0.5)  # from any working directory, as a report makes it
    (tmp_path / "parts" / "mine.toml").write_text(SUITE.format(file="../part.stl"))
    with refused(InputError):
        load_suite(str(tmp_path / "parts" / "mine.toml"))


KINDS = {
    "a.stl": {},
    "b.stl": {"file_type": "stl_ascii"},
    "c.obj": {},
    "d.ply": {},
    "e.ply": {"encoding": "ascii"},
    "f.off": {},
}


@pytest.mark.parametrize("name", KINDS)
@settings(max_examples=25)
@given(
    hurt=st.lists(st.tuples(st.floats(0.0, 1.0, exclude_max=True), st.integers(0, 7)), max_size=4),
    cut=st.one_of(st.none(), st.floats(0.0, 1.0)),
)
def test_a_damaged_mesh_is_read_or_refused(tmp_path_factory, name, hurt, cut):
    """Every file with wrong bits, or cut short, makes a model or an `InputError`: a parser raises anything."""
    file = tmp_path_factory.mktemp("mesh") / name
    trimesh.Trimesh(1e3 * BLOCK.vertices, BLOCK.triangles, process=False).export(file, **KINDS[name])
    data = bytearray(file.read_bytes())
    for where, bit in hurt:
        data[int(where * len(data))] ^= 1 << bit
    file.write_bytes(data if cut is None else data[: int(cut * len(data))])
    with suppress(InputError):
        make_model("mesh", file=str(file), unit="mm")
