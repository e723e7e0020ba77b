"""Making models by name: what each kind takes, and what it refuses."""

import json
import math
from contextlib import suppress
from functools import reduce

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hapticeval.errors import InputError, UnknownNameError
from hapticeval.geometry.catalogue import MODELS, from_geojson, from_vertices, from_wkt, make_model
from hapticeval.geometry.mesh import Mesh

SQUARE = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]
ARGUMENTS = {
    "polygon": {"vertices": SQUARE},
    "wkt": {"text": "POLYGON ((0 0, 1 0, 1 1, 0 1, 0 0))"},
    "mesh": {
        "vertices": [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        "triangles": [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]],
        "unit": "cm",
    },
    "geojson": {"document": {"type": "Polygon", "coordinates": [[*SQUARE, SQUARE[0]]]}},
}


@pytest.mark.parametrize("kind", list(MODELS))
def test_every_kind_is_made_by_name_and_again_from_its_own_parameters(kind):
    model = make_model(kind, **ARGUMENTS.get(kind, {}))
    again = make_model(kind, **json.loads(json.dumps(dict(model.parameters))))
    assert again.name == model.name == kind
    assert type(again.boundary) is type(model.boundary)
    assert np.array_equal(_numbers(again), _numbers(model))


def _numbers(model):
    if isinstance(model.boundary, Mesh):
        return np.concatenate([model.boundary.vertices, model.boundary.triangles])
    return model.curve.pieces if model.dimension == 2 else model.surface.row


@pytest.mark.parametrize("kind", ["star", "cassinian", "circle", "ellipse", "dumbbell"])
def test_size_is_across(kind):
    model = make_model(kind, size=0.5)
    assert np.max(np.hypot(*model.curve.outline(2001).T)) == pytest.approx(0.25, rel=1e-6)


def test_unknown_names_suggest_known_ones(refused):
    with refused(UnknownNameError):
        make_model("casinian")
    with refused(UnknownNameError):
        make_model("star", tipangle=60)
    with refused(InputError):
        make_model("polygon")


@pytest.mark.parametrize(
    ("kind", "parameters", "message"),
    [
        ("circle", {"size": math.nan}, "size = nan"),
        ("circle", {"size": 10**400}, "finite"),
        ("circle", {"size": -0.2}, "positive"),
        ("circle", {"size": "0.2"}, "must be a number"),
        ("circle", {"size": True}, "must be a number"),
        ("circle", {"size": 1e200}, "larger than the float range"),
        ("circle", {"size": 1e-200}, "smaller than the float range"),
        ("star", {"points": 2}, "points = 2"),
        ("star", {"points": 5.5}, "whole number"),
        ("star", {"tip_angle": 108.0}, "no star of 5 points"),
        ("star", {"tip_angle": 0.0}, "no star"),
        ("star", {"points": 3, "tip_angle": 60.0}, "no star of 3 points"),
        ("cassinian", {"a_n": 1.0}, "separate curves"),
        ("cassinian", {"a_n": 0.5}, "separate curves"),
        ("cassinian", {"a_d": 0.0}, "a_d = 0.0"),
        ("cassinian", {"a_n": 1e300, "a_d": 1e-300}, "finite"),
        ("cassinian", {"lobes": 1}, "lobes = 1"),
        ("ellipse", {"ratio": 0.5}, "ratio = 0.5"),
        ("ellipse", {"ratio": 1e9}, "ratio"),
        ("dumbbell", {"neck": 1.0}, "neck = 1.0"),
        ("dumbbell", {"neck": 0.0}, "neck = 0.0"),
        ("sphere", {"size": 0.0}, "positive"),
        ("ellipsoid", {"a": -0.1}, "a = -0.1"),
        ("ellipsoid", {"a": 1.0, "c": 1e-7}, "ratio"),
        ("torus", {"major": 0.03, "minor": 0.03}, "(?s)crosses itself.*minor below major"),
        ("torus", {"major": 1.0, "minor": 1e-7}, "ratio"),
        ("torus", {"minor": 0.0}, "minor = 0.0"),
    ],
)
def test_bad_parameters_are_refused(kind, parameters, message):
    with pytest.raises(InputError, match=message):
        make_model(kind, **parameters)


@pytest.mark.parametrize(
    ("vertices", "message"),
    [
        ([], "0 vertices"),
        ([[0, 0], [1, 0]], "2 vertices"),
        ([[0, 0], [1, 0], [0, 0]], "2 vertices"),
        ([[0, 0], [1, 0], [math.nan, 1]], r"vertex 2 is \(nan, 1.0\)"),
        ([[0, 0], [math.inf, 0], [1, 1]], "vertex 1"),
        ([[0, 0, 0], [1, 0, 0], [1, 1, 0]], "three coordinates"),
        ([[0, 0], [1, 0], [1, 1, 2]], r"vertex 2 is \[1, 1, 2\]"),
        ([[0, 0], [1, 0], "ab"], "vertex 2"),
        ([1.0, 2.0, 3.0], "shape"),
        ("nonsense", "not rows"),
        ([[0, 0], [1, 0], [1, 0], [1, 1]], r"vertices 1 and 2 are the same point \(1, 0\)"),
        ([[0, 0], [2, 0], [1, 1], [2, 2], [0, 2], [1, 1]], "vertices 2 and 5 are the same point"),
        (SQUARE[::-1], "(?s)clockwise.*reverse the order"),
        ([[0, 0], [1, 1], [1, 0], [0, 1]], r"crosses or touches itself at \(0\.5, 0\.5\)"),
        ([[0, 0], [2, 0], [2, 2], [1, 0], [0, 2]], r"crosses or touches itself at \(1, 0\)"),
        ([[0, 0], [1, 1], [2, 2]], "straight line"),
        ([[0, 0], [1, 1], [2, 2], [0.5, 0.5]], "straight line"),
        ([[0, 0], [1e200, 0], [0, 1e200]], "larger than the float range"),
        ([[-1.7e308, 0], [1.7e308, 0], [0, 1.7e308]], "larger than the float range"),
        ([[0, 0], [1e-200, 0], [0, 1e-200]], "smaller than the float range"),
    ],
)
def test_bad_vertices_are_refused(vertices, message):
    with pytest.raises(InputError, match=message):
        from_vertices(vertices)


def test_the_closing_vertex_is_dropped():
    closed = from_vertices([*SQUARE, SQUARE[0]])
    assert np.array_equal(closed.polygon().vertices, SQUARE)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "empty"),
        ("   ", "empty"),
        ("POLYGON EMPTY", "empty"),
        ("POLYGON ((0 0, 1 0, 1 1", "cannot be read"),
        ("POLYGON ((0 0, 1 0, 1 1, 0 1))", "cannot be read"),
        ("POLYGON ((0 0, 0 1, 1 1, 1 0, 0 0))", "clockwise"),
        ("POLYGON ((0 0, 9 0, 9 9, 0 9, 0 0), (1 1, 1 2, 2 2, 1 1))", r"1 hole\(s\)"),
        ("POLYGON Z ((0 0 1, 1 0 1, 1 1 1, 0 0 1))", "three coordinates"),
        ("MULTIPOLYGON (((0 0, 1 0, 1 1, 0 0)), ((5 5, 6 5, 6 6, 5 5)))", "(?s)MultiPolygon.*one outline"),
        ("LINESTRING (0 0, 1 1)", "LineString"),
        ("POINT (0 0)", "Point"),
        ("POLYGON ((0 0, nan 0, 1 1, 0 1, 0 0))", "vertex 1|cannot be read"),
        ("GEOMETRYCOLLECTION (" * 30_000 + ")" * 30_000, "nested too deep"),
        ("(" * 1_000_000, "nested too deep"),
    ],
)
def test_bad_wkt_is_refused(text, message):
    with pytest.raises(InputError, match=message):
        from_wkt(text)


@pytest.mark.parametrize(
    ("document", "message"),
    [
        ("", "empty"),
        ("{", "not JSON"),
        ("[1, 2]", "no 'type'"),
        ({"coordinates": []}, "no 'type'"),
        ({"type": "Polygon"}, "cannot be read"),
        ({"type": "Polygon", "coordinates": []}, "empty"),
        ({"type": "Polygon", "coordinates": [[[0, 0], [1, 0], "x"]]}, "cannot be read"),
        ({"type": "Polygon", "coordinates": [[[0, 0], [math.nan, 0], [1, 1], [0, 0]]]}, "cannot be read"),
        ({"type": "Polygon", "coordinates": [[[0, 0], [0, 1], [1, 1], [0, 0]]]}, "clockwise"),
        ({"type": "Polygon", "coordinates": [[[0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 0, 1]]]}, "three coordinates"),
        ({"type": "Point", "coordinates": [0, 0]}, "Point"),
        ({"type": "FeatureCollection", "features": []}, "FeatureCollection"),
        ({"type": "Feature", "geometry": None, "properties": {}}, "cannot be read"),
        ({"type": "MultiPolygon", "coordinates": [[[[0, 0], [1, 0], [1, 1], [0, 0]]]]}, "MultiPolygon"),
        ('{"type": "GeometryCollection", "geometries": [' * 30_000 + "]}" * 30_000, "levels deep"),
        (reduce(lambda inner, _: {"type": "GeometryCollection", "geometries": [inner]}, range(50), {}), "levels deep"),
        ('{"type": "Polygon", "coordinates": [[[' + "1" * 5000 + ", 0], [1, 0]]]}", "not JSON"),
    ],
)
def test_bad_geojson_is_refused(document, message):
    with pytest.raises(InputError, match=message):
        from_geojson(document)


def test_geojson_as_text_as_feature_and_as_mapping_are_one():
    geometry = ARGUMENTS["geojson"]["document"]
    feature = {"type": "Feature", "properties": {}, "geometry": geometry}
    outlines = [from_geojson(d).polygon().vertices for d in (geometry, json.dumps(geometry), feature)]
    assert all(np.array_equal(outline, SQUARE) for outline in outlines)


@pytest.mark.parametrize("shift", [(1e9, 0.0), (0.0, -1e9), (1e9, 1e9)])
def test_a_model_that_coordinates_cannot_resolve_is_refused(refused, shift):
    square = np.array([[0.0, 0.0], [0.1, 0.0], [0.1, 0.1], [0.0, 0.1]])
    from_vertices(square + 1e-3 * np.array(shift))
    with refused(InputError):
        from_vertices(square + shift)


WORDS = [
    "(",
    ")",
    "((",
    "0 0, ",
    "1e308 ",
    "nan ",
    "POLYGON ",
    "Z ",
    "EMPTY",
    "[",
    "]",
    "{",
    "}",
    '"type":',
    '"Polygon"',
    ",",
]


@settings(max_examples=100)
@given(
    start=st.sampled_from(["POLYGON ((0 0, 1 0, 1 1, 0 0))", json.dumps(ARGUMENTS["geojson"]["document"])]),
    edits=st.lists(
        st.tuples(st.floats(0.0, 1.0), st.integers(0, 9), st.sampled_from(WORDS), st.sampled_from([1, 2, 40_000])),
        max_size=4,
    ),
)
def test_an_edited_outline_is_read_or_refused(start, edits):
    for where, drop, word, times in edits:
        at = int(where * len(start))
        start = start[:at] + times * word + start[at + drop :]
    for read in (from_wkt, from_geojson):
        with suppress(InputError):
            read(start)
