"""The bench on renderers whose error is known: references, refusals, interrupts, and what is written."""

import json
from contextlib import contextmanager
from dataclasses import replace
from functools import cache

import msgspec
import numpy as np
import pytest

from hapticeval.cli import main
from hapticeval.commands.arguments import parse_knobs
from hapticeval.discovery import resolve
from hapticeval.errors import InputError, UnknownNameError
from hapticeval.geometry.catalogue import star
from hapticeval.renderer import Knob, Response, choices_of
from hapticeval.renderers import minimum_distance
from hapticeval.renderers.maps.flow import FlowSettings
from hapticeval.stimulus.stimulus import Path
from hapticeval.study.bench import sweep as sweeping
from hapticeval.study.bench.accuracy import (
    DEEPEST_HAND,
    Answers,
    answers_to,
    errors_against,
    fresh_scene,
    interior_points,
    nearest_of_ours,
    reference_of,
    refinements,
    with_mesh,
    workload,
)
from hapticeval.study.bench.document import BENCH_FILE, Times, join_benches, read_bench, write_bench
from hapticeval.study.bench.judge import describe, describe_missed, describe_unproven, judge_bench
from hapticeval.study.bench.measure import array_bytes, sample_track, step_times, time_builds
from hapticeval.study.bench.sweep import (
    Effort,
    Setting,
    Sweep,
    own_on_meshes,
    settings_by_model,
    settings_of,
)

TINY = Effort(models=("cassinian", "star"), finer=(1, 2, 4), points=60, rounds=3, steps=20, builds=2)


class Blurred:
    """Minimum distance with an IHIP that is off by `blur`(n) metres along x."""

    def __init__(self, blur, values=(1.0, 2.0, 4.0), n=1.0):
        self.blur, self.n = blur, n
        self.knobs = {"n": Knob(values=values, unit="", meaning="how fine")}

    def with_knobs(self, **values):
        return Blurred(self.blur, **values)

    def __call__(self, scene):
        return _Blurred(minimum_distance(scene), self.blur(self.n), scene.stiffness)


class _Blurred:
    def __init__(self, inner, off, stiffness):
        self.inner, self.off, self.stiffness = inner, np.array([off, 0.0]), stiffness

    def reset(self, hip):
        self.inner.reset(hip)

    def step(self, hip, velocity, dt):
        ihip, force = self.inner.step(hip, velocity, dt)
        return Response(ihip + self.off, force + self.stiffness * self.off)


@cache
def small(kind):
    """A workload of few points and a short slide."""
    full = workload(kind, points=1000, seed=0)
    time, points = full.slide.sampled(full.dt)
    return replace(full, points=full.points[:60], slide=Path(0.1 * time[::10], points[::10]))


@pytest.fixture
def work():
    return small("cassinian")


@contextmanager
def little_effort():
    """Benches are on small workloads, with little effort."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sweeping, "QUICK", TINY)
        patch.setattr(sweeping, "workload", lambda kind, points, seed: small(kind))
        yield


def swept(settings, progress=lambda *_: None):
    """A bench of settings, on each model or by model."""
    on_each = settings if isinstance(settings, dict) else dict.fromkeys(TINY.models, settings)
    bench = Sweep(on_each, quick=True, seed=0, command={})
    bench.run(progress)
    return bench


@pytest.fixture
def run():
    """Runs a bench of settings with little effort."""
    with little_effort():
        yield swept


@cache
def swept_once(*names):
    """The bench of renderers with all of their quick settings."""
    with little_effort():
        return swept(settings_of(names, quick=True))


@cache
def swept_on_spheres():
    """A bench on meshes of a sphere, of two that take them and one that refuses them."""
    with little_effort():
        return swept(settings_by_model(["sphere"], ["mapping", "minimum-distance", "constraint"], quick=True))


def test_the_points_are_inside_and_away_from_discontinuities():
    model = star()
    points = interior_points(model, 200, seed=3)
    np.testing.assert_array_equal(points, interior_points(model, 200, seed=3))
    assert model.curve.contains(points).all()
    angle = np.degrees(np.arctan2(points[:, 1], points[:, 0])) - 90.0
    bisector = np.hypot(*points.T) * np.abs(np.sin(np.radians((angle + 36.0) % 72.0 - 36.0)))
    assert bisector.min() > 1.99e-3


def test_errors_of_a_known_offset(work):
    exact = answers_to(minimum_distance(work.scene), work)
    found = errors_against(Answers(exact.ihip + np.array([3e-4, 4e-4]), exact.force), exact, floor=1e-3)
    assert found["ihip"] == pytest.approx({"rms": 5e-4, "p99": 5e-4, "max": 5e-4})
    assert found["force"]["max"] == found["normal"]["max"] == 0.0
    turned = exact.force @ np.array([[np.cos(0.1), np.sin(0.1)], [-np.sin(0.1), np.cos(0.1)]])
    assert errors_against(Answers(exact.ihip, turned), exact, floor=1e-3)["normal"]["rms"] == pytest.approx(
        np.degrees(0.1)
    )


class _Settling(_Blurred):
    """Gets to its answer in three ticks from a reset on, as a proxy does."""

    def reset(self, hip):
        super().reset(hip)
        self.ticks = 0

    def step(self, hip, velocity, dt):
        self.ticks += 1
        ihip, force = super().step(hip, velocity, dt)
        return (ihip, force) if self.ticks > 3 else Response(hip, 0.0 * force)


def test_the_answer_of_a_proxy_is_the_one_that_it_gets_to(work):
    exact = minimum_distance(work.scene)
    found, wanted = (answers_to(made, work) for made in (_Settling(exact, 0.0, 1000.0), exact))
    count = len(work.points)
    np.testing.assert_array_equal(found.ihip[:count], wanted.ihip[:count])


def test_a_projection_is_measured_against_the_same_computed_another_way(work):
    on_polygon = minimum_distance.variant(representation="polygon")
    reference = reference_of("minimum-distance@polygon", on_polygon, work)
    assert reference.source == "minimum-distance by another computation with 1600 samples"
    assert reference.disagreement["ihip"]["max"] < 1e-15
    coarse, fine = (
        errors_against(answers_to(on_polygon.with_knobs(vertices=n)(work.scene), work), reference.answers, floor=1e-3)
        for n in (40, 320)
    )
    assert coarse["ihip"]["rms"] > 4.0 * fine["ihip"]["rms"] > 0.0
    assert reference.claims(fine) == fine
    assert reference.proves(fine)


def test_a_reference_that_has_converged_proves_the_errors_above_it(work):
    reference = reference_of("blurred", Blurred(lambda n: 1e-3 * 100.0**-n), work)
    assert "n 4" in reference.what
    coarse = errors_against(
        answers_to(Blurred(lambda n: 1e-3 * 100.0**-n)(work.scene), work), reference.answers, floor=1e-6
    )
    assert coarse["ihip"]["max"] == pytest.approx(1e-5, rel=1e-3)
    assert reference.proves(coarse)
    assert reference.claims(coarse)["ihip"] == coarse["ihip"]


def test_a_reference_that_has_not_converged_is_not_called_accurate(work):
    factory = Blurred(lambda n: 1e-3 / n)
    reference = reference_of("blurred", factory, work)
    apart = 1e-3 / 2.0 - 1e-3 / 4.0
    finest = errors_against(answers_to(factory.with_knobs(n=4.0)(work.scene), work), reference.answers, floor=1e-6)
    assert finest["ihip"]["max"] == 0.0
    assert not reference.proves(finest)
    assert reference.claims(finest)["ihip"]["max"] == pytest.approx(10.0 * apart)


def test_the_reference_of_a_renderer_without_exact_form_or_knob_is_the_nearest_of_ours(work):
    found = answers_to(Blurred(lambda n: 1e-4)(work.scene), work)
    reference = nearest_of_ours(found, work)
    assert "of ours the nearest" in reference.what
    assert errors_against(found, reference.answers, floor=1e-6)["ihip"]["max"] == pytest.approx(1e-4)


def test_a_quick_reference_is_the_setting_after_the_last_quick_one():
    knob = Knob(values=(1.0, 2.0, 4.0, 8.0), quick=(1.0, 4.0), finest=(16.0, 32.0), unit="", meaning="")
    last = replace(knob, quick=(8.0,), finest=())
    assert refinements({"n": knob}) == ({"n": 16.0}, {"n": 32.0})
    assert refinements({"n": knob}, quick=True) == ({"n": 4.0}, {"n": 8.0})
    assert refinements({"n": last}, quick=True) == refinements({"n": last}) == ({"n": 4.0}, {"n": 8.0})


def test_a_renderer_without_exact_form_or_knob_has_no_reference_of_its_own(refused, work):
    assert reference_of("mine", lambda scene: minimum_distance(scene), work) is None
    with refused(InputError):
        refinements({"n": Knob(values=(1.0,), unit="", meaning="")})


class _OffAtOnePoint(_Blurred):
    """Is off by 7 mm where the hand is at one spot, and right elsewhere."""

    def __init__(self, inner, stiffness, place):
        super().__init__(inner, 0.0, stiffness)
        self.spot = place

    def step(self, hip, velocity, dt):
        ihip, force = self.inner.step(hip, velocity, dt)
        return Response(ihip + np.array([7e-3, 0.0]) * np.array_equal(hip, self.spot), force)


def test_one_place_that_is_off_is_the_accuracy_and_is_named(run, work):
    place = work.points[17]

    def factory(scene):
        return _OffAtOnePoint(minimum_distance(scene), scene.stiffness, place)

    costs = judge_bench(run({"cassinian": [Setting("mine", {}, factory, factory)]}).results(), within=1e-4)
    (found,) = costs.settings
    assert found.errors["ihip"]["rms"] < 1e-3 < 6.999e-3 < found.claims["ihip"]["max"]
    assert found.worst_at == place.tolist()
    assert {answer.label for answer in costs.answers} == {None}, "7 mm are not within 0.1 mm"
    row = next(line for line in describe(costs).splitlines() if line.startswith("* "))
    assert row.split()[2:4] == ["7", "mm"]
    assert f"({1e3 * round(place[0], 4):.6g}, {1e3 * round(place[1], 4):.6g}) mm" in row


def test_winners_are_among_those_that_share_a_reference_alone(run):
    named = ["minimum-distance@polygon", "minimum-distance@curve", "constraint@curve"]
    settings = {"cassinian": settings_of(named, quick=True, chosen={"vertices": (40.0,)})}

    def off(scene):
        return _Blurred(minimum_distance(scene), 1e-4, scene.stiffness)

    settings["cassinian"].append(Setting("off", {}, off, off))
    measured = run(settings).results()
    costs = judge_bench(measured, within=1e-6)
    sources = {setting.renderer: setting.reference for setting in costs.settings}
    nearest, proxy = (f"{name} by another computation with 800 samples" for name in ("minimum-distance", "constraint"))
    assert [sources[name] for name in (*named, "off")] == [nearest, nearest, proxy, nearest]
    steps = {answer.reference: answer.label for answer in costs.answers}
    assert steps == {nearest: "minimum-distance@curve", proxy: "constraint@curve"}
    assert all(setting.front for setting in costs.settings if setting.renderer == "constraint@curve")
    words = describe(costs)
    assert f"cassinian, off from {proxy}, 1 um: constraint@curve (" in words
    assert "errors count from 2 references" in words
    # 40 vertices are off by more than a micrometre, and so is what is off by a tenth of a millimetre.
    assert list(describe_missed(costs, within=1e-6)) == [
        "no setting of minimum-distance@polygon on the cassinian meets --within",
        "no setting of off on the cassinian meets --within",
    ]
    assert len(list(describe_missed(costs, within=1.0, budget=1e-12))) == 4
    assert list(describe_missed(costs, within=1e-6, together=True)) == []
    assert list(describe_missed(costs, within=1.0, budget=1e-12, together=True)) == [
        "no setting of any renderer on the cassinian meets --within"
    ]
    assert list(describe_missed(costs, within=1.0)) == []
    # What an earlier bench has left there neither meets nor misses anything.
    kept = [msgspec.structs.replace(setting, kept=True) for setting in costs.settings]
    assert list(describe_missed(msgspec.structs.replace(costs, settings=kept), within=1e-6)) == []


def test_the_exit_code_says_whether_every_renderer_meets_what_is_asked_for(run, tmp_path, capsys):
    named = ["-r", "minimum-distance@polygon", "-r", "minimum-distance@curve", "--knob", "vertices=40"]
    bench = ["bench", "--quick", "--model", "cassinian", *named, "-o", str(tmp_path)]
    assert main([*bench, "--within", "20mm"]) == 0
    assert "meets --within" not in capsys.readouterr().out
    assert main([*bench, "--within", "1um"]) == 1, "what is exact does not hide what is not"
    assert "no setting of minimum-distance@polygon on the cassinian meets --within\n" in capsys.readouterr().out


def test_the_bench_says_so_and_holds_back_its_answer(run):
    slow = Blurred(lambda n: 1e-3 / n)
    settings = [Setting("blurred", {"n": n}, slow, slow.with_knobs(n=n), {"n": ""}) for n in (1.0, 2.0, 4.0)]
    costs = judge_bench(run(settings).results(), within=1e-4)
    assert all(each.proven is False for each in costs.settings)
    assert [each.label for each in costs.answers] == [None] * 2
    (cassini, starred) = describe_unproven(costs)
    assert "has not converged" in cassini
    assert "n 4" in cassini
    assert "star" in starred
    assert "~2.5 mm" in describe(costs)


def test_settings_are_swept_a_knob_at_a_time_and_chosen_ones_in_every_combination():
    names = [each.label for each in settings_of(["constraint@polygon", "minimum-distance"], quick=True)]
    assert names == [*(f"constraint@polygon vertices {n}" for n in (40, 160, 640)), "minimum-distance"]
    chosen = settings_of(["constraint@polygon"], quick=True, chosen=parse_knobs(["vertices=50,100"]))
    assert [each.values for each in chosen] == [{"vertices": 50.0}, {"vertices": 100.0}]


def test_a_knob_that_no_renderer_has_is_refused_with_the_closest(refused):
    with refused(UnknownNameError):
        settings_of(["constraint@polygon"], quick=True, chosen={"vertexes": (40.0,)})


@pytest.mark.parametrize("text", ["vertices", "vertices=", "=40", "vertices=a", "vertices=40,", "vertices=-1", "n=inf"])
def test_knob_options_that_say_nothing_are_refused(refused, text):
    with refused(InputError):
        parse_knobs([text])
    assert parse_knobs(["cell=1mm,0.5 mm"])["cell"] == pytest.approx((1e-3, 5e-4))


def test_a_bench_from_end_to_end(run, tmp_path):
    settings = settings_of(["minimum-distance@polygon", "ideal"], quick=True)
    bench = run(settings)
    costs = judge_bench(bench.results())
    cassini = [each for each in costs.settings if each.model == "cassinian" and not each.problem]
    assert [each.settings for each in cassini] == [{"vertices": n} for n in (40, 160, 640)]
    rms = [each.errors["ihip"]["rms"] for each in cassini]
    assert rms[0] > 2.5 * rms[1] > 6.25 * rms[2]
    (line,) = costs.orders
    assert line.orders["ihip"] == pytest.approx(1.0, abs=0.15)
    assert cassini[0].memory_bytes < cassini[2].memory_bytes
    for each in cassini:
        assert 0.0 < min(each.step.rounds) <= each.step.median <= each.step.p99
        assert len(each.step.rounds) == TINY.rounds
    assert costs.empty.median < cassini[0].step.median, "what does nothing takes less than what does something"
    assert all(
        each.errors["ihip"]["max"] == 0.0 for each in costs.settings if each.model == "star" and not each.problem
    )
    assert [each.label for each in costs.settings if each.problem] == ["ideal", "ideal"]
    assert {each.exit_code for each in bench.failures} == {0}

    write_bench(tmp_path, costs)
    again = read_bench(tmp_path)
    assert again == costs
    assert "order of convergence, minimum-distance@polygon on the cassinian" in describe(again)
    assert "a call that does nothing takes" in describe(again)


def test_settings_of_other_renderers_stay_beside_new_ones():
    old, new = (swept_once(name) for name in ("minimum-distance@polygon", "minimum-distance@curve"))
    before, after = old.results(), new.results()
    joined = join_benches(after, before)
    assert [each.kept for each in joined.settings] == [True] * len(before.settings) + [False] * len(after.settings)
    assert {each.renderer for each in joined.references} == {"minimum-distance@polygon", "minimum-distance@curve"}
    assert len({each.key for each in joined.settings}) == len(joined.settings)
    for each, once in zip(joined.settings, before.settings, strict=False):
        assert (each.label, each.step) == (once.label, once.step)
    again = join_benches(after, joined)
    assert [each.label for each in again.settings] == [each.label for each in joined.settings]
    elsewhere = msgspec.structs.replace(before, machine={**before.machine, "processor": "another"})
    assert join_benches(after, elsewhere) == after


def test_ctrl_c_keeps_what_was_measured(run):
    def stop(done, total, what):
        if "round 3" in what:
            raise KeyboardInterrupt

    costs = judge_bench(run(settings_of(["minimum-distance"], quick=True), stop).results())
    assert (costs.complete, costs.reason, costs.rounds) == (False, "interrupted by the user", 2)
    assert costs.settings[0].step is not None
    assert "incomplete: interrupted" in describe(costs)


def test_a_setting_that_breaks_leaves_the_others(run):
    bench = run(settings_of(["minimum-distance@polygon"], quick=True, chosen={"vertices": (2.0, 40.0)}))
    broken, whole = (each for each in bench.results().settings if each.model == "cassinian")
    assert "polygon of 2 vertices" in broken.problem
    assert broken.step is None
    assert whole.problem is None
    assert {each.exit_code for each in bench.failures} == {2}


def test_timing_asks_for_as_many_steps_as_it_says(work):
    class Counting:
        calls = 0

        def reset(self, hip):
            pass

        def step(self, hip, velocity, dt):
            self.calls += 1
            hip *= 2.0
            velocity *= 2.0
            return hip, velocity

    renderer, track = Counting(), sample_track(work.slide, work.dt)
    samples = step_times(renderer, track, 30, first=1990)
    assert samples.shape == (30,)
    np.testing.assert_array_equal(track.hips, sample_track(work.slide, work.dt).hips, "a step changes its own copy")
    assert renderer.calls == 30 + 200


def test_a_build_is_timed_on_a_fresh_model_each_time():
    seen = []
    scenes = (fresh_scene("star", k) for k in range(3))
    made, taken, before = time_builds(len, lambda scene: seen.append(scene.model) or seen, scenes, 3)
    assert made == 1, "the first, of what was given for it"
    assert len(before) == len(taken) == len({model.parameters["size"] for model in seen}) == 3


def test_memory_counts_every_buffer_once():
    class Holder:
        __slots__ = ("a", "more")

    one = np.zeros(1000)
    holder = Holder()
    holder.a, holder.more = one, {"view": one[::2], "own": [np.zeros(10, dtype=np.float32)], "self": holder}
    assert array_bytes(holder) == 8000 + 40
    assert array_bytes(holder.__class__) == 0
    table = np.zeros(50)
    assert array_bytes(lambda: table) == 400


@pytest.mark.parametrize(
    "change",
    [
        lambda text: text[:1],
        lambda text: json.dumps({**json.loads(text), "format_version": 4}),
        lambda text: json.dumps({**json.loads(text), "format_version": None}),
        lambda text: json.dumps({k: v for k, v in json.loads(text).items() if k != "orders"}),
        lambda text: json.dumps({**json.loads(text), "settings": [{}]}),
        lambda text: "[]",
    ],
)
def test_a_damaged_bench_is_refused(refused, run, tmp_path, change):
    empty = run([]).results()
    write_bench(tmp_path, empty)
    assert read_bench(tmp_path) == empty
    file = tmp_path / BENCH_FILE
    file.write_text(change(file.read_text()))
    with refused(InputError):
        read_bench(tmp_path)


def test_on_meshes_a_renderer_is_off_by_what_their_triangles_are():
    costs = judge_bench(swept_on_spheres().results())
    of = {
        name: [each for each in costs.settings if each.renderer == name] for name in ("minimum-distance", "constraint")
    }
    for name, found in of.items():
        assert [each.settings["triangles"] for each in found] == [80, 320, 1280], name
        for each, finer in zip(found, TINY.finer, strict=True):
            mesh = with_mesh(fresh_scene("sphere", 0), finer).model.boundary
            a, b, c = mesh.vertices[mesh.triangles.T]
            sides = [np.linalg.norm(one - other, axis=1) for one, other in ((a, b), (b, c), (c, a))]
            area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
            widest = float(np.max(np.prod(sides, axis=0) / (4.0 * area)))  # of the circles round the triangles
            turned = np.arcsin(
                widest / (0.1 - DEEPEST_HAND)
            )  # a face against the sphere's normal, at most, as deep as that
            sagitta = 0.1 - np.sqrt(0.1**2 - widest**2)
            assert 0.5 * sagitta < each.errors["ihip"]["max"] < sagitta + DEEPEST_HAND * np.tan(turned)
            assert each.errors["normal"]["max"] < np.degrees(turned)
            assert each.proven
    assert all(0.5 < line.orders["ihip"] < 1.0 for line in costs.orders), "of the area: between length and its square"
    exact, nearest = (each.what for each in costs.references)
    assert exact == "the exact curve"
    assert nearest.endswith("on the exact curve, of ours the nearest to it"), "constraint takes no sphere"


def test_a_table_in_space_is_of_the_finest_mesh_alone(monkeypatch):
    monkeypatch.setattr(sweeping, "QUICK", TINY)
    (table,) = settings_by_model(["torus"], ["minimum-distance@lut"], quick=True)["torus"]
    assert table.values == {"triangles": 2.0 * 32 * 59, "cell": 4e-3}, "round the tube, and about the axis"
    chosen = settings_by_model(["torus"], ["minimum-distance@lut"], quick=True, chosen={"cell": (8e-3, 4e-3)})["torus"]
    assert [each.values["cell"] for each in chosen] == [8e-3, 4e-3]


def test_ours_that_take_meshes_are_found_by_asking_them():
    found = own_on_meshes()
    assert {"minimum-distance", "constraint", "minimum-distance@lut"} <= set(found)
    assert not {"mapping", "conformal", "ideal", "set-stabilisation"} & set(found)


def test_a_model_that_no_bench_has_is_refused():
    with pytest.raises(UnknownNameError):
        settings_by_model(["cube"], ["minimum-distance"], quick=True)


def test_a_refusal_is_no_fault_while_something_is_measured_and_is_noted():
    bench = swept_on_spheres()
    assert bench.failures == []
    noted = describe(judge_bench(bench.results())).partition("Not measured:\n")[2].splitlines()
    assert noted[0].startswith("   mapping (3 settings) on the sphere: ")
    assert noted[1] == ""


def test_the_time_to_make_a_mesh_is_no_time_to_build_a_renderer(run):
    finest = [each for each in swept_on_spheres().results().settings if each.renderer == "minimum-distance"][-1]
    assert 0.0 < min(finest.build_seconds) < min(finest.mesh_seconds), "which triangulates, checks, and makes a tree"
    assert swept_once("minimum-distance@curve").results().settings[0].mesh_seconds == []
    assert {each.exit_code for each in run(settings_by_model(["sphere"], ["mapping"], quick=True)).failures} == {2}


def test_the_quick_reference_of_the_flow_is_one_that_the_flow_takes():
    for quick in (True, False):
        for settings in refinements(choices_of(resolve("mapping")).knobs, quick=quick):
            FlowSettings(**{name: value if name == "gap" else int(value) for name, value in settings.items()})


def test_what_no_scene_calls_for_is_measured_beside_what_the_factory_made():
    uncalled = swept_once("minimum-distance@curve").results().uncalled
    assert uncalled.renderer == "minimum-distance@curve"
    assert uncalled.same_law
    assert uncalled.ratio > 0.0


def test_tails_are_told_of_a_quiet_machine_alone():
    results = swept_once("minimum-distance@curve").results()
    for tail, is_quiet in ((1.4e-7, True), (1.6e-7, False)):
        empty = Times(median=1e-7, p99=tail, rounds=[1e-7])
        told = msgspec.structs.replace(results, empty=empty)
        assert told.is_quiet is is_quiet
        words = describe(judge_bench(told, within=1e-3))
        assert ("99 % of steps in" in words) is is_quiet
        assert ("tails are left out" in words) is not is_quiet
    assert not msgspec.structs.replace(results, empty=None).is_quiet
