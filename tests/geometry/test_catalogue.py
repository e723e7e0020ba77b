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
    # Star and sphere are poor guesses: all are named beside them.
    with refused(UnknownNameError):
        make_model("square")
    with refused(InputError):
        make_model("polygon")


@pytest.mark.parametrize(
    ("kind", "parameters"),
    [
        ("circle", {"size": math.nan}),
        ("circle", {"size": 10**400}),
        ("circle", {"size": -0.2}),
        ("circle", {"size": "0.2"}),
        ("circle", {"size": True}),
        ("circle", {"size": 1e200}),
        ("circle", {"size": 1e-200}),
        ("star", {"points": 2}),
        ("star", {"points": 5.5}),
        ("star", {"tip_angle": 108.0}),
        ("star", {"tip_angle": 0.0}),
        ("star", {"points": 3, "tip_angle": 60.0}),
        ("cassinian", {"a_n": 1.0}),
        ("cassinian", {"a_n": 0.5}),
        ("cassinian", {"a_d": 0.0}),
        ("cassinian", {"a_n": 1e300, "a_d": 1e-300}),
        ("cassinian", {"lobes": 1}),
        ("ellipse", {"ratio": 0.5}),
        ("ellipse", {"ratio": 1e9}),
        ("dumbbell", {"neck": 1.0}),
        ("dumbbell", {"neck": 0.0}),
        ("sphere", {"size": 0.0}),
        ("ellipsoid", {"a": -0.1}),
        ("ellipsoid", {"a": 1.0, "c": 1e-7}),
        ("torus", {"major": 0.03, "minor": 0.03}),
        ("torus", {"major": 1.0, "minor": 1e-7}),
        ("torus", {"minor": 0.0}),
    ],
)
def test_bad_parameters_are_refused(refused, kind, parameters):
    with refused(InputError):
        make_model(kind, **parameters)


@pytest.mark.parametrize(
    "vertices",
    [
        [],
        [[0, 0], [1, 0]],
        [[0, 0], [1, 0], [0, 0]],
        [[0, 0], [1, 0], [math.nan, 1]],
        [[0, 0], [math.inf, 0], [1, 1]],
        [[0, 0, 0], [1, 0, 0], [1, 1, 0]],
        [[0, 0], [1, 0], [1, 1, 2]],
        [[0, 0], [1, 0], "ab"],
        [1.0, 2.0, 3.0],
        "nonsense",
        [[0, 0], [1, 0], [1, 0], [1, 1]],
        [[0, 0], [2, 0], [1, 1], [2, 2], [0, 2], [1, 1]],
        SQUARE[::-1],
        [[0, 0], [1, 1], [1, 0], [0, 1]],
        [[0, 0], [2, 0], [2, 2], [1, 0], [0, 2]],
        [[0, 0], [1, 1], [2, 2]],
        [[0, 0], [1, 1], [2, 2], [0.5, 0.5]],
        [[0, 0], [1e200, 0], [0, 1e200]],
        [[-1.7e308, 0], [1.7e308, 0], [0, 1.7e308]],
        [[0, 0], [1e-200, 0], [0, 1e-200]],
    ],
)
def test_bad_vertices_are_refused(refused, vertices):
    with refused(InputError):
        from_vertices(vertices)


def test_the_closing_vertex_is_dropped():
    closed = from_vertices([*SQUARE, SQUARE[0]])
    assert np.array_equal(closed.polygon().vertices, SQUARE)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "   ",
        "POLYGON EMPTY",
        "POLYGON ((0 0, 1 0, 1 1",
        "POLYGON ((0 0, 1 0, 1 1, 0 1))",
        "POLYGON ((0 0, 0 1, 1 1, 1 0, 0 0))",
        "POLYGON ((0 0, 9 0, 9 9, 0 9, 0 0), (1 1, 1 2, 2 2, 1 1))",
        "POLYGON Z ((0 0 1, 1 0 1, 1 1 1, 0 0 1))",
        "MULTIPOLYGON (((0 0, 1 0, 1 1, 0 0)), ((5 5, 6 5, 6 6, 5 5)))",
        "LINESTRING (0 0, 1 1)",
        "POINT (0 0)",
        "POLYGON ((0 0, nan 0, 1 1, 0 1, 0 0))",
        "GEOMETRYCOLLECTION (" * 30_000 + ")" * 30_000,
        "(" * 1_000_000,
    ],
)
def test_bad_wkt_is_refused(refused, text):
    with refused(InputError):
        from_wkt(text)


@pytest.mark.parametrize(
    "document",
    [
        "",
        "{",
        "[1, 2]",
        {"coordinates": []},
        {"type": "Polygon"},
        {"type": "Polygon", "coordinates": []},
        {"type": "Polygon", "coordinates": [[[0, 0], [1, 0], "x"]]},
        {"type": "Polygon", "coordinates": [[[0, 0], [math.nan, 0], [1, 1], [0, 0]]]},
        {"type": "Polygon", "coordinates": [[[0, 0], [0, 1], [1, 1], [0, 0]]]},
        {"type": "Polygon", "coordinates": [[[0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 0, 1]]]},
        {"type": "Point", "coordinates": [0, 0]},
        {"type": "FeatureCollection", "features": []},
        {"type": "Feature", "geometry": None, "properties": {}},
        {"type": "MultiPolygon", "coordinates": [[[[0, 0], [1, 0], [1, 1], [0, 0]]]]},
        '{"type": "GeometryCollection", "geometries": [' * 30_000 + "]}" * 30_000,
        reduce(lambda inner, _: {"type": "GeometryCollection", "geometries": [inner]}, range(50), {}),
        '{"type": "Polygon", "coordinates": [[[' + "1" * 5000 + ", 0], [1, 0]]]}",
    ],
)
def test_bad_geojson_is_refused(refused, document):
    with refused(InputError):
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
