import contextlib
import dataclasses
import json
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hapticeval.errors import InputError
from hapticeval.files import replacing
from hapticeval.phenomena.verdict import Finding, Level, Metric, Outcome, Verdict
from hapticeval.runner.results import (
    Results,
    environment,
    file_stem,
    read_results,
    to_json,
    validate,
    verdict_document,
    write_results,
)


def verdict(finding, published=None, level=Level.MUST):
    return Verdict("constraint", "thesis", "slide", "continuous-contact", level, finding, published)


def results(**changes):
    run = {
        "suite": "thesis",
        "case": "slide",
        "renderer": "constraint",
        "recording": "recordings/thesis/slide/constraint.h5",
        "simulated_seconds": 8.0,
        "wall_seconds": 0.25,
        "stimulus": "trajectory",
        "title": "Sliding",
        "citation": "6.1.2",
        "model": {"kind": "cassinian", "parameters": {"size": 0.2}},
        "depth_of": "model",
        "judged": True,
        "scene": {
            "stiffness": 1e3,
            "damping": 0.0,
            "mass": 0.1,
            "bilateral": False,
            "restitution": 0.0,
            "sampling_time": 1e-3,
        },
        "error": None,
    }
    finding = Finding(Outcome.PASS, "no jump", Metric("IHIP jump", 1e-5, "m"), 1e-4, {"time": 0.5})
    whole = {
        "planned": 1,
        "ran": 1,
        "complete": True,
        "reason": None,
        "environment": environment(),
        "seed": 7,
        "command": {"suites": ["thesis"], "renderers": ["constraint"], "selection": None},
        "runs": [run],
        "verdicts": [verdict_document(verdict(finding, Outcome.PASS))],
        "table": {"Resists Pop-Through on Curves": {"constraint": "Yes"}},
        "timing": {"simulated_seconds": 8.0, "wall_seconds": 0.25, "times_real_time": 32.0},
    }
    return Results(**{**whole, **changes})


def test_reads_back_what_was_written(tmp_path):
    path = write_results(tmp_path / "out", results())
    assert path == tmp_path / "out" / "results.json"
    assert read_results(tmp_path / "out") == results()
    assert [file.name for file in path.parent.iterdir()] == ["results.json"]


def test_a_verdict_keeps_metric_bound_and_margin():
    finding = Finding(Outcome.FAIL, "jumps", Metric("jump", 3e-3, "m"), 1e-3, {"hip": np.array([0.1, 0.2])})
    document = verdict_document(verdict(finding, Outcome.FAIL))
    assert document["metric"] == {"name": "jump", "value": 3e-3, "unit": "m"}
    assert document["margin"] == pytest.approx(-2e-3)
    assert document["evidence"] == {"hip": [0.1, 0.2]}
    assert (document["outcome"], document["published"], document["as_expected"]) == ("fail", "fail", True)


def test_a_failed_must_without_publication_is_not_as_expected():
    assert not verdict_document(verdict(Finding(Outcome.FAIL, "jumps")))["as_expected"]
    assert verdict_document(verdict(Finding(Outcome.FAIL, "jumps"), level=Level.INFO))["as_expected"]


def test_numbers_that_json_cannot_hold_become_null_and_are_told():
    finding = Finding(
        Outcome.FAIL, "diverged", Metric("gain", math.inf, ""), 2.0, {"slope": float("nan"), "gains": [1.0, -math.inf]}
    )
    document = verdict_document(verdict(finding))
    assert document["metric"]["value"] is None
    assert document["margin"] is None
    assert document["evidence"]["gains"] == [1.0, None]
    assert document["evidence"]["not_finite"] == [
        "metric.value = inf",
        "evidence.slope = nan",
        "evidence.gains[1] = -inf",
    ]
    text = to_json(results(verdicts=[document]))
    validate(json.loads(text, parse_constant=lambda name: pytest.fail(f"{name} was written")))


def test_numpy_values_are_written_as_json():
    finding = Finding(
        Outcome.PASS,
        "fine",
        Metric("jump", np.float64(1.5), "m"),
        np.float32(2.0),
        {"samples": np.int64(3), "stuck": np.bool_(True), "of": (1, "two"), "level": Level.INFO},
    )
    document = json.loads(json.dumps(verdict_document(verdict(finding))))
    assert document["evidence"] == {"samples": 3, "stuck": True, "of": [1, "two"], "level": "info"}
    assert document["margin"] == 0.5


def test_evidence_that_is_no_json_is_refused_by_name():
    with pytest.raises(InputError, match=r"verdict\.evidence\.curve is a object"):
        verdict_document(verdict(Finding(Outcome.PASS, "fine", evidence={"curve": object()})))


@pytest.mark.parametrize(
    ("change", "place"),
    [
        ({"verdicts": [{"outcome": "passed"}]}, "verdicts[0]"),
        ({"seed": "seven"}, "seed"),
        ({"complete": False, "reason": None, "ran": 0}, "reason"),
        ({"table": {"Row": {"constraint": "Perhaps"}}}, "table.Row.constraint"),
        ({"planned": 3}, "1 of 3"),
        ({"ran": 3}, "3 of 1"),
    ],
)
def test_what_does_not_fit_is_refused_with_its_place(tmp_path, change, place):
    with pytest.raises(InputError) as caught:
        write_results(tmp_path, results(**change))
    assert place in str(caught.value)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("path", ["/etc/passwd", "recordings/../../x.h5", "other/x.h5", "recordings/.."])
def test_a_recording_lies_below_the_result_folder(path):
    document = json.loads(to_json(results()))
    document["runs"][0]["recording"] = path
    with pytest.raises(InputError, match="recording"):
        validate(document)


def test_each_unreadable_folder_says_what_is_wrong(tmp_path):
    with pytest.raises(InputError, match="no result folder"):
        read_results(tmp_path / "gone")
    with pytest.raises(InputError, match=r"holds no results\.json"):
        read_results(tmp_path)
    path = write_results(tmp_path, results())
    good = path.read_text()
    path.write_text(good[: len(good) // 2])
    with pytest.raises(InputError, match=r"results\.json is not JSON: line \d+, column \d+"):
        read_results(tmp_path)
    path.write_text(good.replace('"seed": 7', '"seed": NaN'))
    with pytest.raises(InputError, match="not JSON") as caught:
        read_results(tmp_path)
    assert "NaN" in caught.value.why
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match="not JSON"):
        read_results(tmp_path)
    path.write_text("[" * 100_000)
    with pytest.raises(InputError, match="not JSON"):
        read_results(tmp_path)
    path.write_text("[]")
    with pytest.raises(InputError, match="does not fit"):
        read_results(tmp_path)
    path.write_text(good.replace('"format_version": 1', '"format_version": 2'))
    with pytest.raises(InputError, match="format 2; this hapticeval reads format 1") as caught:
        read_results(tmp_path)
    assert caught.value.todo == "update hapticeval"
    path.write_text(good.replace('"outcome": "pass"', '"outcome": "perhaps"'))
    with pytest.raises(InputError, match=r"results\.json .* verdicts\[0\]\.outcome"):
        read_results(tmp_path)


def test_a_failed_write_keeps_the_old_file(tmp_path):
    path = tmp_path / "results.json"
    path.write_text("old")
    with contextlib.suppress(RuntimeError), replacing(path) as temporary:
        temporary.write_text("half of the n")
        raise RuntimeError
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_the_environment_names_versions_and_no_host():
    found = environment()
    assert set(found["versions"]) == {"hapticeval", "numpy", "scipy", "numba", "shapely", "h5py"}
    assert found["versions"]["numpy"] == np.__version__
    import platform

    assert platform.node() not in json.dumps(found).split('"')
    assert "/" not in json.dumps(found)


def test_results_are_frozen():
    with pytest.raises(dataclasses.FrozenInstanceError):
        results().seed = 8


@settings(max_examples=50)
@given(names=st.sets(st.text(max_size=80), min_size=2, max_size=30))
def test_file_stems_are_safe_and_never_collide(names):
    stems = [file_stem(name) for name in names]
    assert len({stem.lower() for stem in stems}) == len(names)
    for stem in stems:
        assert set(stem) <= set("abcdefghijklmnopqrstuvwxyz0123456789._-~")
        assert 0 < len(stem) <= 60
        assert not stem.startswith(".")


def test_file_stems_of_renderer_names():
    assert file_stem("minimum-distance") == "minimum-distance"
    assert file_stem("constraint+pp-d@polygon").startswith("constraint-pp-d-polygon~")
    hard = ["a/b", "a:b", "a+b", "a@b", "a-b", "A-b", "..", ".", "", "a.", "a~b", "mine:make", "x" * 61]
    assert len({file_stem(name) for name in hard}) == len(hard)
    assert "/" not in "".join(file_stem(name) for name in hard)
