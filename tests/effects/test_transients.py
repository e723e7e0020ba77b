"""What begins with a contact: impulses, decaying sinusoids and recorded pulses, put on the answers of any renderer."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from leading import led

from hapticeval.devices.device import apparent_mass
from hapticeval.devices.parallelogram import Parallelogram2, Parallelogram3
from hapticeval.discovery import resolve
from hapticeval.effects.catalogue import make_effect
from hapticeval.effects.transients import MATERIALS, ContactImpulse, ContactTransient, RecordedImpulse
from hapticeval.errors import InputError, UnknownNameError
from hapticeval.geometry.catalogue import make_model
from hapticeval.recordings.hdf5 import write_recording
from hapticeval.recordings.recording import Recording
from hapticeval.scene import Scene
from hapticeval.simulation.answers import make_renderer
from hapticeval.simulation.closed_loop import simulate_closed_loop
from hapticeval.stimulus.stimulus import Experiment

SPEED, DEPTH = 0.2, 2e-3
PULSE = RecordedImpulse((3.0, -1.0, 0.7, 0.1), 1e-3)
ALL = (
    ContactImpulse(),
    ContactImpulse(10.0),
    ContactTransient(material="wood"),
    ContactTransient(40.0, 60.0, 90.0),
    PULSE,
)


def into(duration, dt=1e-3, speed=SPEED, start=0.00505):
    """Straight down on to a line and held there: HIPs that reach the line between two ticks."""
    height = np.maximum(start - speed * dt * np.arange(round(duration / dt)), -DEPTH)
    return np.column_stack([np.zeros(height.size), height])


def taps(count=3, each=100):
    """Up and down through a line, `count` contacts."""
    tick = np.arange(count * each)
    return np.column_stack([np.zeros(tick.size), 0.004 * np.cos(2.0 * np.pi * tick / each) + 1e-5])


def added(effect, hips, dt=1e-3, base="minimum-distance", **more):
    """The force (n,), N, along the normal of a line that an effect adds along a path, and where there is contact."""
    scene = Scene(model=make_model("line"), sampling_time=dt, **more)
    plain = led(resolve(base)(scene), hips, dt)
    found = led(make_renderer(resolve(base), scene.with_effects(effect)), hips, dt)
    assert np.array_equal(found[0], plain[0])
    assert not (found[1] - plain[1])[:, 0].any()
    return found[1][:, 1] - plain[1][:, 1], np.any(plain[0] != hips, axis=1)


# The impulse of (4.21)


@pytest.mark.parametrize(
    ("cap", "restitution", "expected"),
    [(math.inf, 0.0, [20.0]), (10.0, 0.0, [10.0, 10.0]), (8.0, 0.0, [8.0, 8.0, 4.0]), (math.inf, 0.5, [30.0])],
)
def test_an_impulse_stops_the_tool_s_mass_in_the_first_tick(cap, restitution, expected):
    """.1 kg at .2 m/s: 20 mN s."""
    force, contact = added(ContactImpulse(cap), into(0.1), restitution=restitution)
    first = int(np.argmax(contact))
    np.testing.assert_allclose(force[first : first + len(expected)], expected, rtol=1e-12)
    np.testing.assert_allclose(np.delete(force, np.arange(first, first + len(expected))), 0.0, atol=1e-12)


def test_the_mass_is_the_device_s_at_the_place():
    """The golden number of (4.21): q = (.3, -.2), rates (.5, -.8), n = (0, 1)."""
    joints, rates, normal = np.array([0.3, -0.2]), np.array([0.5, -0.8]), np.array([0.0, 1.0])
    device = Parallelogram2()
    place, velocity = device.position(joints), device.jacobian(joints) @ rates
    assert -apparent_mass(device, place, normal) * velocity[1] == pytest.approx(0.049785553417, rel=1e-10)


@given(
    turned=st.lists(st.floats(-0.4, 0.4), min_size=3, max_size=3),
    direction=st.lists(st.floats(0.1, 1.0), min_size=3, max_size=3),
    size=st.sampled_from([2, 3]),
)
def test_the_compiled_mass_is_that_of_the_equations(turned, direction, size):
    from hapticeval.effects.transient_kernels import linkage_mass

    device = Parallelogram2() if size == 2 else Parallelogram3()
    normal = np.array(direction[:size]) / np.linalg.norm(direction[:size])
    place = device.position(np.array(turned[:size]))
    found = linkage_mass(device.parameters, place, normal)
    assert found == pytest.approx(apparent_mass(device, place, normal), rel=1e-9)
    velocity = np.array([0.1, -0.3, 0.2])[:size]
    rates = np.linalg.solve(device.jacobian(device.joints(place)), velocity)
    # What the blow m_n v along the normal does to the joints takes out the speed along it, and no other share of it.
    blow = -found * float(normal @ velocity) * normal
    change = np.linalg.solve(device.inertia(device.joints(place)), device.jacobian(device.joints(place)).T @ blow)
    after = device.jacobian(device.joints(place)) @ (rates + change)
    assert float(normal @ after) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("device", [None, Parallelogram2()])
def test_an_impulse_takes_the_speed_out_of_a_device_in_closed_loop(device):
    """What is left after a tick is what friction and the spring of one tick's depth make."""
    trial = Experiment(0.05, np.array([0.0, 0.0021]), np.array([0.0, -SPEED]), np.zeros(1), np.zeros((1, 2)))
    scene = Scene(model=make_model("line"), device=device, mass=0.3, stiffness=200.0)
    speeds = []
    for effects in ((), (ContactImpulse(),)):
        chosen = scene.with_effects(*effects)
        run = simulate_closed_loop(make_renderer(resolve("minimum-distance"), chosen), trial, chosen, 1e-3)
        first = int(np.argmax(np.any(run.ihip != run.hip, axis=1)))
        speeds.append(run.velocity[first : first + 2, 1])
    assert speeds[0][1] < -0.9 * SPEED
    assert speeds[1][0] == speeds[0][0]
    assert abs(speeds[1][1]) < 0.02 * SPEED


# Decaying sinusoids


@pytest.mark.parametrize(
    ("material", "seconds"), [("rubber", 6.8999e-3), ("wood", 4.4954e-3), ("aluminium", 1.5596e-3)]
)
@pytest.mark.parametrize("dt", [1e-3, 0.37e-3])
def test_the_impulse_of_a_material_is_the_integral_at_any_sampling_time(material, seconds, dt):
    effect = ContactTransient(material=material)
    omega = 2.0 * math.pi * effect.frequency
    whole = effect.amplitude * omega / (effect.decay**2 + omega**2)
    assert whole / effect.amplitude == pytest.approx(seconds, rel=1e-4)
    force, contact = added(effect, into(21.0 / effect.decay + 0.04, dt), dt)
    assert np.sum(force) * dt == pytest.approx(SPEED * whole, rel=1e-9)
    assert np.flatnonzero(force)[0] == np.flatnonzero(contact)[0]


@pytest.mark.parametrize(("frequency", "percent"), [(100.0, 3.4), (300.0, 31.6)])
def test_samples_at_the_ticks_would_lose_some_of_it(frequency, percent):
    """Why ticks hold means."""
    time, omega = 1e-3 * np.arange(500), 2.0 * math.pi * frequency
    whole = omega / (90.0**2 + omega**2)
    sampled = 1e-3 * np.sum(np.exp(-90.0 * time) * np.sin(omega * time))
    assert 100.0 * (1.0 - sampled / whole) == pytest.approx(percent, abs=0.05)
    force, _ = added(ContactTransient(1.0, 90.0, frequency), into(0.4))
    assert np.sum(force) * 1e-3 == pytest.approx(SPEED * whole, rel=1e-9)


def test_a_cap_carries_over_what_it_holds_back():
    effect, free = (ContactTransient(300.0, 90.0, 30.0, cap=cap) for cap in (2.0, math.inf))
    force, whole = (added(each, into(0.6))[0] for each in (effect, free))
    assert np.abs(whole).max() > 10.0
    assert np.abs(force).max() == pytest.approx(2.0, rel=1e-12)
    assert np.sum(force) == pytest.approx(np.sum(whole), rel=1e-9)


# Recorded pulses


def test_a_pulse_is_replayed_to_the_bit_and_keeps_its_impulse_at_another_rate():
    force, contact = added(PULSE, into(0.1), stiffness=1e-9)
    first = int(np.argmax(contact))
    scene = Scene(model=make_model("line"), effects=(PULSE,))
    renderer = make_renderer(lambda _: Silent(), scene)
    found = led(renderer, into(0.1), 1e-3)[1][:, 1]
    assert found[first : first + 4].tolist() == list(PULSE.pulse)
    assert not np.delete(found, np.arange(first, first + 4)).any()
    for dt in (0.3e-3, 0.7e-3, 2.5e-3):
        other, _ = added(PULSE, into(0.1, dt), dt)
        assert np.sum(other) * dt == pytest.approx(np.sum(force) * 1e-3, rel=1e-6)


class Silent:
    """A contact point without a force."""

    def reset(self, hip):
        pass

    def step(self, hip, velocity, dt):
        return np.array([hip[0], max(hip[1], 0.0)]), np.zeros(2)


def test_a_pulse_is_read_from_a_table_and_from_a_recording(refused, tmp_path):
    time, force = 5e-4 * np.arange(4), np.array([0.5, 2.0, 1.0, -0.25])
    (tmp_path / "tap.csv").write_text(
        "t,f\n" + "".join(f"{t!r},{f!r}\n" for t, f in zip(time.tolist(), force.tolist(), strict=True))
    )
    normal = np.array([0.6, 0.8])
    zeros = np.zeros((4, 2))
    write_recording(
        tmp_path / "tap.h5", Recording(time, {"hip": zeros, "ihip": zeros, "force": np.outer(force, normal)})
    )
    for name in ("tap.csv", "tap.h5"):
        effect = make_effect({"kind": "recorded-impulse", "file": name, "cap": 5.0}, tmp_path)
        assert effect.step == pytest.approx(5e-4)
        assert effect.pulse == pytest.approx(force)
        assert make_effect(effect.document()) == effect
    with refused(InputError):
        make_effect({"kind": "recorded-impulse", "file": "../tap.csv"}, tmp_path)
    (tmp_path / "short.csv").write_text("t,f\n0,1\n")
    with refused(InputError):
        make_effect({"kind": "recorded-impulse", "file": "short.csv"}, tmp_path)
    (tmp_path / "gap.csv").write_text("t,f\n0,1\n0.001,2\n0.003,1\n")
    with refused(InputError):
        make_effect({"kind": "recorded-impulse", "file": "gap.csv"}, tmp_path)
    with refused(InputError):
        make_effect({"kind": "recorded-impulse", "file": "tap.csv", "step": 1.0}, tmp_path)


# What they have in common


@pytest.mark.parametrize("effect", ALL, ids=lambda each: each.kind)
@pytest.mark.parametrize("base", ["minimum-distance", "constraint"])
def test_each_contact_has_one_that_ends_with_it(effect, base):
    """Three taps: the same each time, from the first tick of contact on, and nothing in free space."""
    force, contact = added(effect, taps(), base=base)
    begins = np.flatnonzero(np.diff(contact.astype(int)) == 1) + 1
    assert begins.size == 3
    assert not force[~contact].any()
    first, *others = (force[begin : begin + 30] for begin in begins)
    assert first[0] > 0.0
    for other in others:
        np.testing.assert_allclose(other, first, rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("effect", ALL, ids=lambda each: each.kind)
def test_a_run_that_begins_in_contact_has_no_beginning_of_it(effect):
    hips = into(0.1)[::-1]
    assert not added(effect, hips)[0].any()


@pytest.mark.parametrize(
    "make",
    [
        lambda: ContactTransient(1.0, 0.0, 10.0),
        lambda: ContactTransient(1.0, -5.0, 10.0),
        lambda: ContactTransient(1.0, math.nan, 10.0),
        lambda: ContactTransient(math.nan, 5.0, 10.0),
        lambda: ContactTransient(1.0, 5.0, 10.0, cap=0.0),
        lambda: ContactTransient(1.0, 5.0),
        lambda: ContactTransient(1.0, 5.0, 10.0, material="wood"),
        lambda: ContactImpulse(-1.0),
        lambda: ContactImpulse(math.nan),
        lambda: RecordedImpulse((), 1e-3),
        lambda: RecordedImpulse((0.0, 0.0), 1e-3),
        lambda: RecordedImpulse((1.0, math.inf), 1e-3),
        lambda: RecordedImpulse((1.0,), 0.0),
        lambda: of_line(ContactTransient(1.0, 5.0, 500.0)),
        lambda: of_line(ContactImpulse(), bilateral=True),
        lambda: of_line(PULSE, bilateral=True),
        lambda: RecordedImpulse(("hard",), 1e-3),
    ],
)
def test_what_makes_no_sense_is_refused(refused, make):
    with refused(InputError):
        make()


def test_an_unknown_material_is_refused_with_the_closest(refused):
    with refused(UnknownNameError):
        ContactTransient(material="aluminum")
    assert set(MATERIALS) == {"rubber", "wood", "aluminium"}


def of_line(effect, **more):
    return Scene(model=make_model("line"), effects=(effect,), **more)
