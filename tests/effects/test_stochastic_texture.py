"""Stochastic textures: filters between stable ones are stable, and what they make of noise is what was asked for."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from leading import led
from msgspec import structs
from scipy.signal import welch

from hapticeval.discovery import resolve
from hapticeval.effects import texture_kernels as kernels
from hapticeval.effects import texture_toolkit
from hapticeval.effects.catalogue import make_effect
from hapticeval.effects.line_spectra import coefficients_of, line_spectrum, stable
from hapticeval.effects.stochastic_texture import StochasticTexture
from hapticeval.effects.texture import (
    Filter,
    Texture,
    as_document,
    autocovariance,
    named,
    power_spectrum,
    read_texture,
    shipped,
)
from hapticeval.effects.texture_toolkit import read_toolkit
from hapticeval.errors import InputError, UnknownNameError
from hapticeval.examples.studies.texture import as_toml
from hapticeval.examples.studies.texture import main as show_texture
from hapticeval.geometry.catalogue import make_model
from hapticeval.scene import Scene
from hapticeval.simulation.answers import make_renderer

RIBBED = {"mass": 0.5, "texture": "ribbed"}


def rendered(model="line", base="minimum-distance", **effect):
    scene = Scene(model=make_model(model), effects=(StochasticTexture(**(RIBBED | effect)),))
    return make_renderer(resolve(base), scene)


def stroke(speed, depth, seconds):
    return np.column_stack([speed * 1e-3 * np.arange(round(1e3 * seconds)), np.full(round(1e3 * seconds), -depth)])


def filters(order):
    """Coefficients of stable filters of an order, by their poles."""
    pairs = arrays(np.float64, (order // 2, 2), elements=st.floats(0.02, 0.98))
    return st.tuples(pairs, st.floats(-0.95, 0.95)).map(lambda drawn: _polynomial(*drawn, order))


def _polynomial(pairs, real, order):
    """Of pole pairs (radius, place in its own share of the half circle)."""
    turn = math.pi / max(len(pairs), 1)
    roots = [r * np.exp(sign * 1j * turn * (k + x)) for k, (r, x) in enumerate(pairs) for sign in (1, -1)]
    return np.real(np.poly(roots + [real] * (order % 2)))[1:]


@given(st.integers(1, 20).flatmap(filters))
def test_line_spectra_are_the_coefficients(coefficients):
    spectrum = line_spectrum(coefficients)
    assert np.all(np.diff([0.0, *spectrum, math.pi]) > 0.0)
    size = np.abs(coefficients).max()
    np.testing.assert_allclose(coefficients_of(spectrum), coefficients, atol=1e-9 * max(size, 1.0))


def test_no_filter_between_stable_ones_is_unstable_and_between_coefficients_some_are():
    """1,200 filters in triangles of three random ones, of the orders that measured textures have."""
    rng = np.random.default_rng(3)
    unstable = {"line spectra": 0, "coefficients": 0}
    for _ in range(300):
        order = int(rng.choice([4, 8, 14, 20]))
        given_ = []
        for _ in range(3):
            pairs = np.column_stack([rng.uniform(0.5, 0.99, order // 2), rng.uniform(0.02, 0.98, order // 2)])
            given_.append(_polynomial(pairs, 0.0, order))
        spectra = [line_spectrum(each) for each in given_]
        for shares in rng.dirichlet(np.ones(3), 4):
            between = coefficients_of(np.average(spectra, axis=0, weights=shares))
            assert np.all(np.diff(np.average(spectra, axis=0, weights=shares)) > 0.0)
            unstable["line spectra"] += bool(np.abs(np.roots([1.0, *between])).max() >= 1.0)
            mixed = np.average(given_, axis=0, weights=shares)
            within = bool(np.abs(np.roots([1.0, *mixed])).max() < 1.0)
            assert stable(mixed) == within
            unstable["coefficients"] += not within
    assert unstable["line spectra"] == 0
    assert unstable["coefficients"] > 5


def test_the_noise_is_the_published_counter_based_one():
    """The known answers of philox2x32-10 that come with Random123."""
    full = 0xFFFFFFFF
    for given_, answer in (
        ((0, 0, 0), (0xFF1DAE59, 0x6CD10DF2)),
        ((full, full, full), (0x2C3F628B, 0xAB4FD7AD)),
        ((0x243F6A88, 0x85A308D3, 0x13198A2E), (0xDD7CE038, 0xF62A4C12)),
    ):
        assert kernels.philox(*given_) == answer
        assert getattr(kernels.philox, "py_func", kernels.philox)(*given_) == answer


def test_the_noise_is_white_normal_and_its_seed_s():
    count = 40_000
    noise = np.array([kernels.normal_noise(k, 7) for k in range(count)])
    assert abs(noise.mean()) < 4 / math.sqrt(count)
    assert abs(noise.var() - 1.0) < 4 * math.sqrt(2 / count)
    assert abs((noise**4).mean() - 3.0) < 4 * math.sqrt(96 / count)
    for lag in (1, 2, 3, 10):
        assert abs(np.mean(noise[lag:] * noise[:-lag])) < 4 / math.sqrt(count)
    other = np.array([kernels.normal_noise(k, 8) for k in range(1000)])
    assert abs(np.corrcoef(noise[:1000], other)[0, 1]) < 4 / math.sqrt(1000)


@pytest.mark.parametrize("name", shipped())
@pytest.mark.parametrize(("speed", "depth"), [(0.1, 1e-3), (0.13, 0.7e-3)])
def test_vibrations_have_the_spectrum_of_their_filter(name, speed, depth):
    """At a filter of the texture and between some: Welch's estimate over 10 s, within its 99.9 % quantile of .62 dB."""
    force = led(rendered(texture=name), stroke(speed, depth, 10.0), 1e-3)[1]
    np.testing.assert_allclose(force[:, 1], 1e3 * depth, rtol=1e-12)
    at = named(name).between(speed, 1e3 * depth)
    _, found = welch(force[1:, 0] / 0.5, 1e3, nperseg=256)
    covariance = autocovariance(at, 256)
    window = np.hanning(257)[:256]
    lags = np.correlate(window, window, "full")[255:] / (window @ window)
    asked = np.abs(np.fft.rfft(np.concatenate([covariance * lags, [0.0], (covariance * lags)[:0:-1]])))[::2] * 2e-3
    error = 10 * np.log10(found / asked)[2:-1]
    assert math.sqrt(np.mean(error**2)) < 0.62


def test_power_spectrum_and_covariance_are_of_one_filter():
    at = named("ribbed").between(0.12, 0.8)
    frequency = np.linspace(0.0, 500.0, 20_001)
    whole = np.trapezoid(power_spectrum(at, 1e3, frequency), frequency)
    assert whole == pytest.approx(autocovariance(at, 3)[0], rel=1e-6)
    assert math.sqrt(named("ribbed").between(0.1, 1.0).variance) > 0.0
    assert math.sqrt(autocovariance(named("ribbed").between(0.1, 1.0), 1)[0]) == pytest.approx(2.0, rel=1e-4)


def test_between_is_the_kernels_filter_and_nearest_on_the_hull_outside():
    texture = named("gritty")
    for each in texture.filters:
        found = texture.between(each.speed, each.force)
        assert found.variance == pytest.approx(each.variance, abs=1e-12)
        np.testing.assert_allclose(found.ar, each.ar, atol=1e-12)
    outside, corner = texture.between(5.0, 70.0), texture.between(0.2, 2.0)
    assert outside == corner
    assert texture.between(0.3, 1.2).force == pytest.approx(1.2)
    assert texture.between(0.3, 1.2).speed == pytest.approx(0.2)


def test_the_way_of_the_vibration():
    """Along the stroke, across it in the surface, or along the normal, where it never pulls."""
    hips = np.zeros((400, 3))
    hips[:, 0], hips[:, 2] = 1e-4 * np.arange(400), 0.099
    hips *= 0.099 / np.linalg.norm(hips, axis=1)[:, np.newaxis]
    normal = hips / 0.099
    along = np.gradient(hips, axis=0)
    along /= np.linalg.norm(along, axis=1)[:, np.newaxis]
    across = np.cross(along, normal)
    bare = led(resolve("minimum-distance")(Scene(model=make_model("sphere"))), hips, 1e-3)[1]
    for direction, way in (("along", along), ("across", across), ("normal", normal)):
        shaken = led(rendered("sphere", direction=direction), hips, 1e-3)[1] - bare
        size = np.abs(np.sum(shaken * way, axis=1))[2:]
        assert size.max() > 0.1
        np.testing.assert_allclose(size, np.linalg.norm(shaken, axis=1)[2:], rtol=1e-4)
    pressed = led(rendered("sphere", direction="normal", mass=5.0), hips, 1e-3)[1]
    assert np.sum(pressed * normal, axis=1).min() == pytest.approx(0.0, abs=1e-12)


def test_a_sample_is_held_where_the_loop_is_faster_and_nothing_shakes_without_pressure_or_speed():
    hips = np.column_stack([np.arange(2000) * 2.5e-5, np.full(2000, -1e-3)])
    fine = led(rendered(), hips, 2.5e-4)[1][:, 0]
    assert np.count_nonzero(np.diff(fine)) <= 500
    assert np.std(fine) == pytest.approx(np.std(led(rendered(), hips[::4], 1e-3)[1][:, 0]), rel=0.3)
    free = led(rendered(), hips * [1.0, -1.0], 1e-3)[1]
    assert not free.any()
    still = led(rendered(), np.full((500, 2), -1e-3), 1e-3)[1]
    assert not still[:, 0].any()


def test_shipped_textures_are_read_back_to_the_bit(refused, tmp_path):
    assert len(shipped()) == 3
    for name in shipped():
        texture = named(name)
        (tmp_path / "copy.toml").write_text(as_toml(texture))
        assert read_texture(tmp_path / "copy.toml") == texture
        whole = StochasticTexture(mass=0.1, texture=json.loads(json.dumps(as_document(texture))))
        assert whole.model == texture
        assert make_effect(json.loads(json.dumps(whole.document()))) == whole
    table = {"kind": "stochastic-texture", "mass": 0.1, "file": "copy.toml"}
    assert make_effect(table, tmp_path) == whole
    with refused(InputError):
        make_effect(table | {"texture": "ribbed"}, tmp_path)
    with refused(InputError):
        make_effect(table | {"file": "../copy.toml"}, tmp_path)
    assert StochasticTexture(**RIBBED).document() == {"kind": "stochastic-texture", "mass": 0.5, "texture": "ribbed"}


PLAIN = Filter(speed=0.0, force=0.0, variance=1.0, ar=(0.5, 1.0))
THREE = (PLAIN, structs.replace(PLAIN, speed=0.1), structs.replace(PLAIN, force=1.0))


@pytest.mark.parametrize(
    "changes",
    [
        {"ar": (1.0, 0.5)},
        {"ar": (0.5, math.nan)},
        {"ar": (0.5, 3.2)},
        {"ar": (0.5,)},
        {"ma": (0.5, 0.4)},
        {"variance": -1.0},
        {"speed": math.nan},
        {"gain": math.inf},
        {"gain": -1e308},
        {"variance": 1e300},
    ],
)
def test_unsound_filters_are_refused_with_their_number(refused, changes):
    with refused(InputError):
        Texture(title="x", rate=1e3, filters=(*THREE[:2], structs.replace(THREE[2], **changes)))


@pytest.mark.parametrize(
    "changes",
    [
        {"rate": 0.0},
        {"friction": -0.1},
        {"filters": ()},
        {"filters": THREE[:2]},
        {"filters": (*THREE[:2], structs.replace(PLAIN, speed=0.3))},
        {"triangles": ((0, 1, 3),)},
        {"triangles": ((0, 1, 1),)},
    ],
)
def test_what_is_no_texture_is_refused(refused, changes):
    with refused(InputError):
        Texture(**({"title": "x", "rate": 1e3, "filters": THREE} | changes))


def test_effects_refuse_what_they_cannot_use(refused):
    with refused(UnknownNameError):
        StochasticTexture(mass=0.1, texture="ribed")
    for number in ({"mass": -0.1}, {"direction": "up"}, {"seed": -1}):
        with refused(InputError):
            StochasticTexture(**(RIBBED | number))
    with refused(InputError):
        rendered(direction="across")
    slow = Texture(title="x", rate=1e4, filters=THREE)
    with refused(InputError):
        Scene(model=make_model("line"), effects=(StochasticTexture(mass=0.1, texture=slow),))
    assert Scene(model=make_model("line"), effects=(StochasticTexture(mass=0.0, texture="ribbed"),)).effects == ()
    with refused(InputError):
        line_spectrum([-2.2 * math.cos(0.4), 1.21])


def toolkit_file(texture, *, order=None):
    """A model file as the toolkit publishes them, with models in another order than its lists."""

    def values(name, numbers):
        return f"<{name}>" + "".join(f"<value>{x!r}</value>" for x in numbers) + f"</{name}>"

    models = [
        f"<model>{values('ARlsf', each.ar)}{values('MAlsf', each.ma) if each.ma else ''}<var>{each.variance!r}</var>"
        f"<gain>{each.gain!r}</gain><speedMod>{1e3 * each.speed!r}</speedMod>"
        f"<forceMod>{each.force!r}</forceMod></model>"
        for each in texture.filters
    ]
    corners = texture.corners() + 1
    return (
        '<?xml version="1.0" encoding="utf-8"?><modelSet>'
        f"<material>made up</material><mu>{texture.friction}</mu><numMod>{len(models)}</numMod>"
        f"<numTri>{len(corners)}</numTri><maxSpeed>200</maxSpeed><maxForce>2</maxForce>"
        f"{values('speedList', [1e3 * each.speed for each in texture.filters])}"
        f"{values('forceList', [each.force for each in texture.filters])}"
        + "".join(values("tri", row.tolist()) for row in corners)
        + f"<numARCoeff>{len(texture.filters[0].ar)}</numARCoeff><numMACoeff>{len(texture.filters[0].ma)}</numMACoeff>"
        + "".join(models[k] for k in (order or range(len(models))))
        + "</modelSet>"
    )


@pytest.mark.parametrize("name", ["ribbed", "gritty"])
def test_a_toolkit_s_file_becomes_a_texture(tmp_path, name):
    texture = named(name)
    file = tmp_path / "Models_Ours.xml"
    file.write_text(toolkit_file(texture, order=[*range(5, 16), *range(5)]))
    found = read_toolkit(file, rate=1e3)
    assert (found.title, found.friction, found.rate) == ("Ours", texture.friction, 1e3)
    for speed, force in ((0.1, 1.0), (0.07, 0.3), (0.3, 5.0)):
        one, other = found.between(speed, force), texture.between(speed, force)
        for field in ("variance", "gain", "ar", "ma"):
            np.testing.assert_allclose(getattr(one, field), getattr(other, field), rtol=1e-9)
    assert read_texture_again(tmp_path, found) == found


def test_the_command_takes_a_toolkit_s_file_over(tmp_path, capsys):
    file = tmp_path / "Models_Ours.xml"
    file.write_text(toolkit_file(named("gritty")))
    assert show_texture([str(file), "--rate", "1000", "-o", str(tmp_path / "ours.toml")]) == 0
    assert read_texture(tmp_path / "ours.toml") == read_toolkit(file, rate=1e3)
    shown = capsys.readouterr().out
    assert "Ours: 16 filters of 4 poles and 0 zeros for 1000 Hz" in shown
    assert "0.1 m/s        1 N   rms 4 m/s^2" in shown
    assert show_texture([str(file)]) == 2
    assert "does not give its rate" in capsys.readouterr().err
    assert show_texture(["ribbed", "--rate", "1000"]) == 2
    assert show_texture(["ribbed"]) == 0


def read_texture_again(folder, texture):
    (folder / "again.toml").write_text(as_toml(texture))
    return read_texture(folder / "again.toml")


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("</modelSet>", ""),
        ("modelSet>", "models>"),
        ("<mu>0.8</mu>", ""),
        ("<mu>0.8</mu>", "<mu>much</mu>"),
        ("<numMod>16</numMod>", "<numMod>15</numMod>"),
        ("<mu>0.8</mu>", "<mu>nan</mu>"),
        ("<speedList><value>0.0</value>", "<speedList>"),
        ("speedList", "speeds"),
        ("<tri><value>", "<tri><value>4</value><value>"),
        ("<tri><value>", "<tri><value>9"),
    ],
)
def test_a_file_that_is_none_of_the_toolkit_is_refused(refused, tmp_path, old, new):
    text = toolkit_file(named("gritty"))
    assert old in text
    (tmp_path / "broken.xml").write_text(text.replace(old, new, 1 if old.startswith("<") else -1))
    with refused(InputError):
        read_toolkit(tmp_path / "broken.xml", rate=1e3)


def test_a_file_that_is_absent_too_large_or_no_text_is_refused(refused, tmp_path, monkeypatch):
    (tmp_path / "bytes.xml").write_bytes(b"\xff\xfe")
    for name in ("absent.xml", "bytes.xml"):
        with refused(InputError):
            read_toolkit(tmp_path / name, rate=1e3)
    monkeypatch.setattr(texture_toolkit, "MOST_FILE_BYTES", 1)
    with refused(InputError):
        read_toolkit(tmp_path / "bytes.xml", rate=1e3)


def test_entities_of_a_file_s_own_are_refused(refused, tmp_path):
    text = toolkit_file(named("gritty")).replace("?><modelSet>", '?><!DOCTYPE m [<!ENTITY a "b">]><modelSet>')
    (tmp_path / "bomb.xml").write_text(text)
    with refused(InputError):
        read_toolkit(tmp_path / "bomb.xml", rate=1e3)


def test_a_speed_that_jumps_from_tick_to_tick_does_not_switch_filters():
    """As one from an encoder does: two stable filters that are alternated each tick run away here."""
    calm = Filter(speed=0.0, force=0.0, variance=0.01, ar=tuple(line_spectrum(_polynomial([(0.97, 0.1)], 0.0, 2))))
    keen = structs.replace(calm, speed=0.1, ar=tuple(line_spectrum(_polynomial([(0.97, 0.8)], 0.0, 2))))
    texture = Texture(title="x", rate=1e3, filters=(calm, keen, structs.replace(calm, force=5.0)))
    jumpy = stroke(0.0, 1e-3, 4.0)
    jumpy[:, 0] = 1e-4 * np.cumsum(np.arange(4000) % 2)  # a tick at rest, a tick at .1 m/s
    smooth = stroke(0.05, 1e-3, 4.0)
    rms = [np.std(led(rendered(texture=texture, mass=1.0), hips, 1e-3)[1][:, 0]) for hips in (jumpy, smooth)]
    between = math.sqrt(autocovariance(texture.between(0.05, 1.0), 1)[0])
    assert rms == pytest.approx([between] * 2, rel=0.2)
    switched = [coefficients_of(each.ar) for each in (calm, keen)]
    transition = np.eye(2)
    for a in switched:
        transition = np.array([-a, [1.0, 0.0]]) @ transition
    assert np.abs(np.linalg.eigvals(transition)).max() > 1.5


@settings(max_examples=30)
@given(st.floats(0.0, 1.0), st.floats(0.0, 10.0))
def test_shares_of_a_triangle_are_shares(speed, force):
    rows = named("woven").rows()
    for guess in (0, 5):
        _, *shares = kernels.filters_at(rows, 16, speed, force, guess)
        assert sum(shares) == pytest.approx(1.0)
        assert min(shares) >= -1e-9
