"""results.json: one definition, from which what is written, what is read and the schema come."""

from __future__ import annotations

import contextlib
import json
import math
import platform

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from result_entries import changed, results_of, run_entry

from hapticeval.devices.inner_loop import InnerLoop
from hapticeval.errors import InputError
from hapticeval.files import digest_of, file_stem, replacing
from hapticeval.phenomena.verdict import Finding, Level, Metric, Outcome, Verdict
from hapticeval.recordings.difference import Apart, Difference
from hapticeval.recordings.recording import Recording
from hapticeval.runner.results import (
    Ended,
    Problem,
    Refusal,
    Replay,
    Robot,
    SceneEntry,
    SuiteEntry,
    VerdictEntry,
    environment,
    read_results,
    results_schema,
    write_results,
)


def verdict(finding, published=None, level=Level.MUST):
    return Verdict("constraint", "thesis", "slide", "continuous-contact", level, finding, published)


def entry(finding, *more):
    return VerdictEntry.of(verdict(finding, *more))


@pytest.fixture
def whole():
    """Results with every entry that there is."""
    scene = SceneEntry(
        stiffness=1e3, damping=0.0, mass=0.1, bilateral=True, restitution=0.0, sampling_time=1e-3,
        device=Robot(kind="point-mass"), inner_loop=InnerLoop.STATIC, effects=[{"kind": "delay", "time": 1e-3}],
    )  # fmt: skip
    replay = Replay(
        file="a.h5", note="n", clock="regular", stretches=1, rows=9, rows_left_out=0, left_out=[], suspicious=["s"],
        seconds=1.0, difference=Difference(Apart(1e-4, 1e-3, 0.5, 500), None, 9, 0.1),
    )  # fmt: skip
    problem = Problem(what="a", why="b", todo="c")
    runs = [
        run_entry(recording="recordings/s/c/r.h5", closed_form="6.24", ended=Ended(tick=3, time=0.1, what="x", why="")),
        run_entry(renderer="q", error=problem, scene=scene, replay=replay),
        run_entry(renderer="p", refusal=Refusal(what="a", why="b", todo="c", position=[0.1, 0.2])),
    ]
    finding = Finding(Outcome.PASS, "no jump", Metric("IHIP jump", 1e-5, "m"), 1e-4, {"time": 0.5})
    table = {"Resists Pop-Through on Curves": {"constraint": "Yes"}}
    suites = [SuiteEntry(name="s", title="S", citation="", rows=list(table))]
    return results_of(verdict(finding, Outcome.PASS), runs=runs, table=table, published_table=table, suites=suites)


def test_reads_back_what_was_written(tmp_path, whole):
    path = write_results(tmp_path / "out", whole)
    assert path == tmp_path / "out" / "results.json"
    assert read_results(tmp_path / "out") == whole
    assert [file.name for file in path.parent.iterdir()] == ["results.json"]
    document = json.loads(path.read_text())
    assert list(document)[:3] == ["format_version", "planned", "ran"]
    assert ["replay" in run for run in document["runs"]] == [False, True, False], "absent where there is none"
    assert all(run.keys() >= {"shows", "ended", "error", "refusal", "closed_form"} for run in document["runs"])
    with pytest.raises(AttributeError):
        whole.seed = 8


def test_the_schema_is_that_of_what_is_written(tmp_path, whole):
    jsonschema = pytest.importorskip("jsonschema")
    validator = jsonschema.Draft202012Validator(results_schema())
    document = json.loads(write_results(tmp_path, whole).read_text())
    validator.validate(document)
    document["runs"][0]["model"] = {}
    document["verdicts"][0]["outcome"] = "perhaps"
    assert len(list(validator.iter_errors(document))) == 2


def test_a_verdict_keeps_metric_bound_and_margin():
    found = entry(
        Finding(Outcome.FAIL, "jumps", Metric("jump", 3e-3, "m"), 1e-3, {"hip": np.array([0.1, 0.2])}), Outcome.FAIL
    )
    assert (found.metric.name, found.metric.value, found.metric.unit) == ("jump", 3e-3, "m")
    assert found.margin == pytest.approx(-2e-3)
    assert found.evidence == {"hip": [0.1, 0.2]}
    assert (found.outcome, found.published, found.as_expected) == ("fail", "fail", False), "print is no excuse"


def test_a_failed_must_without_publication_is_not_as_expected():
    assert not entry(Finding(Outcome.FAIL, "jumps")).as_expected
    assert entry(Finding(Outcome.FAIL, "jumps"), None, Level.INFO).as_expected


def test_numbers_that_json_cannot_hold_become_null_and_are_told(tmp_path):
    found = entry(
        Finding(
            Outcome.FAIL, "diverged", Metric("gain", math.inf, ""), 2.0,
            {"slope": float("nan"), "gains": [1.0, -math.inf]},
        )
    )  # fmt: skip
    assert (found.metric.value, found.margin, found.evidence["gains"]) == (None, None, [1.0, None])
    lost = ["metric.value = inf", "evidence.slope = nan", "evidence.gains[1] = -inf"]
    assert found.evidence["not_finite"] == lost
    text = write_results(tmp_path, results_of(found)).read_text()
    json.loads(text, parse_constant=lambda name: pytest.fail(f"{name} was written"))


def test_numpy_values_are_written_as_json_and_what_is_no_json_is_refused_by_name(refused):
    evidence = {"samples": np.int64(3), "stuck": np.bool_(True), "of": (1, "two"), "level": Level.INFO}
    found = entry(Finding(Outcome.PASS, "fine", Metric("jump", np.float64(1.5), "m"), np.float32(2.0), evidence))
    document = json.loads(msgspec.json.encode(found))
    assert document["evidence"] == {"samples": 3, "stuck": True, "of": [1, "two"], "level": "info"}
    assert document["margin"] == 0.5
    with refused(InputError):
        entry(Finding(Outcome.PASS, "fine", evidence={"curve": object()}))


def test_what_could_not_be_read_is_not_written(refused, tmp_path, whole):
    with refused(InputError):
        write_results(tmp_path, changed(whole, verdicts=[changed(whole.verdicts[0], outcome="passed")]))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "change",
    [
        lambda text: text[: len(text) // 2],
        lambda text: text.replace('"seed": 3', '"seed": NaN'),
        lambda text: "[" * 100_000,
        lambda text: "[]",
        lambda text: text.replace('"seed": 3', '"seed": "seven"'),
        lambda text: text.replace('"format_version": 1', '"format_version": 2'),
        lambda text: text.replace(' "format_version": 1,', ""),
        lambda text: text.replace('"outcome": "pass"', '"outcome": "perhaps"'),
        lambda text: text.replace('"Yes"', '"Maybe"'),
        lambda text: text.replace('"planned": 1', '"planned": 3'),
        lambda text: text.replace('"ran": 1', '"ran": 3'),
        lambda text: text.replace('"complete": true', '"complete": false'),
        lambda text: text.replace('"kind": "cassinian"', '"name": "x"'),
        lambda text: text.replace('"strict"', '"struct"'),
        *(
            lambda text, path=path: text.replace("recordings/s/c/r.h5", path)
            for path in ("/etc/passwd", "recordings/../../x.h5", "other/x.h5", "recordings/..")
        ),
    ],
)
def test_what_is_cut_edited_or_of_another_version_is_refused_with_its_place(refused, tmp_path, whole, change):
    path = write_results(tmp_path, whole)
    path.write_text(change(path.read_text()))
    with refused(InputError):
        read_results(tmp_path)


@pytest.mark.parametrize(
    "change",
    [
        lambda document: {"verdicts": [*document["verdicts"], *document["verdicts"]], "planned": 2, "ran": 2},
        lambda document: {"verdicts": [{**document["verdicts"][0], "bound": 0.0}]},
    ],
    ids=["one verdict twice", "a pass beyond its bound"],
)
def test_a_document_that_says_what_no_run_says_is_refused(refused, tmp_path, whole, change):
    path = write_results(tmp_path, whole)
    document = json.loads(path.read_text())
    path.write_text(json.dumps(document | change(document)))
    with refused(InputError):
        read_results(tmp_path)


def test_a_folder_that_holds_none_says_so(refused, tmp_path):
    with refused(InputError):
        read_results(tmp_path / "gone")
    with refused(InputError):
        read_results(tmp_path)
    (tmp_path / "results.json").write_bytes(b"\xff\xfe\x00")
    with refused(InputError):
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
    assert platform.node() not in json.dumps(found).split('"')
    assert "/" not in json.dumps(found)


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


def test_a_model_of_a_file_is_made_from_where_the_recording_has_it_and_only_while_it_is_the_same(refused, tmp_path):
    file = tmp_path / "cube.off"
    file.write_text("OFF\n4 4 0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 1 2 3\n3 0 3 2\n", encoding="utf-8")
    model = {"kind": "mesh", "file": str(file), "unit": "m"}
    entry = run_entry(model={**model, "file": file.name, "sha256": digest_of(file)})
    points = np.zeros((3, 3))
    recording = Recording(np.arange(3) * 1e-3, {"hip": points}, {"scene": {"model": model}})
    assert entry.build_model(recording).dimension == 3
    with refused(InputError):
        entry.build_model(None)
    file.write_text(file.read_text(encoding="utf-8") + "# other\n", encoding="utf-8")
    with refused(InputError):
        entry.build_model(recording)
