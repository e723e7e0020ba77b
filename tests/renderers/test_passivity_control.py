"""The passivity controller of Hannaford and Ryu: around whatever it is put, the hand gets no more than it has given."""

import numpy as np
import pytest
from hand_paths import SMOOTH, ticked, walks
from hypothesis import given, settings
from hypothesis import strategies as st

from hapticeval.discovery import known_modifiers, resolve
from hapticeval.effects.sensors import ForceSensor
from hapticeval.errors import RefusalError, UnknownNameError
from hapticeval.geometry.catalogue import circle, line
from hapticeval.renderer import Declaration, Response, choices_of, configured, wrapped
from hapticeval.renderers.field.passivity_control import passivity_controlled
from hapticeval.scene import Scene
from hapticeval.simulation.answers import make_renderer


class Whatever:
    """Answers each HIP with the next of given forces."""

    standoff = 1e-4
    declares = Declaration(spring="error", force_resolution=1e-3)

    def __init__(self, forces):
        self.forces = forces

    def reset(self, hip):
        self.rest = iter(self.forces)

    def step(self, hip, velocity, dt):
        return Response(hip, next(self.rest))


@given(hips=walks(), seed=st.integers(0, 2**32 - 1), dimension=st.sampled_from([2, 3]))
def test_the_energy_is_never_negative_and_no_force_grows(hips, seed, dimension):
    hips = np.column_stack([hips, hips[:, 0] * hips[:, 1]])[:, :dimension]
    forces = 10.0 * np.random.default_rng(seed).normal(size=hips.shape)
    controlled = passivity_controlled(lambda scene: Whatever(forces))(Scene(model=circle()))
    _, changed = ticked(controlled, hips)
    given_in = -np.cumsum(np.sum(changed[1:] * np.diff(hips, axis=0), axis=1))
    assert given_in.min(initial=0.0) >= -1e-9 * np.abs(forces).max()
    assert np.all(np.linalg.norm(changed, axis=1) <= np.linalg.norm(forces, axis=1) + 1e-9)


@given(hips=walks(), seed=st.integers(0, 2**32 - 1))
def test_only_what_is_along_the_motion_is_changed(hips, seed):
    forces = np.random.default_rng(seed).normal(size=hips.shape)
    controlled = passivity_controlled(lambda scene: Whatever(forces))(Scene(model=circle()))
    _, changed = ticked(controlled, hips)
    moves, taken = np.diff(hips, axis=0), (changed - forces)[1:]
    np.testing.assert_allclose(moves[:, 0] * taken[:, 1] - moves[:, 1] * taken[:, 0], 0.0, atol=1e-9)
    assert np.all(np.sum(moves * taken, axis=1) <= 1e-9)
    np.testing.assert_array_equal(changed[0], forces[0])


def test_it_is_the_inner_renderer_where_that_is_passive():
    hips = np.column_stack([np.zeros(400), 0.01 * np.cos(np.linspace(0.0, 20.0, 400))])
    for name in ("minimum-distance", "constraint@curve", "virtual-proxy"):
        plain, controlled = (
            ticked(resolve(each)(Scene(model=line())), hips)
            for each in (name, f"{name}+pc".replace("@curve+pc", "+pc@curve"))
        )
        np.testing.assert_array_equal(plain[0], controlled[0])
        np.testing.assert_array_equal(plain[1], controlled[1])


@settings(max_examples=10)
@given(hips=walks())
def test_the_ihip_stays_and_a_reset_forgets(hips):
    inner, controlled = (resolve(name)(Scene(model=SMOOTH["cassinian"])) for name in ("conformal", "conformal+pc"))
    first = ticked(controlled, hips)
    np.testing.assert_array_equal(first[0], ticked(inner, hips)[0])
    np.testing.assert_array_equal(first[1], ticked(controlled, hips)[1])


def test_a_map_gives_energy_until_what_the_way_in_has_stored_is_spent_and_then_drags():
    """The conformal map gives 15.1 mJ a lap, and the observer lets it until what the way in has put there is spent."""
    start, centre, radius, ticks, laps = np.array([0.11, 0.02]), np.array([0.08, 0.012]), 0.004, 500, 6
    edge = centre + radius * (start - centre) / np.linalg.norm(start - centre)
    angle = np.arctan2(*(edge - centre)[::-1]) + 2.0 * np.pi * np.arange(1, laps * ticks + 1) / ticks
    circle_round = centre + radius * np.column_stack([np.cos(angle), np.sin(angle)])
    hips = np.vstack([start + np.linspace(0.0, 1.0, 250)[:, np.newaxis] * (edge - start), circle_round])
    gained = {}
    for name in ("conformal", "conformal+pc"):
        _, forces = ticked(resolve(name)(Scene(model=SMOOTH["cassinian"])), hips)
        work = np.cumsum(np.sum(0.5 * (forces[1:] + forces[:-1]) * np.diff(hips, axis=0), axis=1))
        gained[name] = np.diff(work[248::ticks])
    np.testing.assert_allclose(gained["conformal"], 15.11e-3, atol=0.02e-3)
    np.testing.assert_allclose(
        gained["conformal+pc"], [15.11e-3, 15.11e-3, 15.11e-3, 8.58e-3, 0.14e-3, 0.14e-3], atol=0.02e-3
    )


def test_a_name_puts_it_around_any_renderer_and_what_that_says_stays():
    assert set(known_modifiers()) == {"pc"}
    controlled = resolve("constraint+pp-v+pc@curve")(Scene(model=circle()))
    plain = resolve("constraint+pp-v@curve")(Scene(model=circle()))
    inner = controlled.renderer.inner
    assert inner.renderer.regulation.name == "pp-v"
    assert controlled.surface is inner.surface
    assert controlled.resolution == wrapped(plain).resolution
    assert controlled.law is None
    assert choices_of(resolve("coupled+pc")).supports == choices_of(resolve("coupled")).supports
    assert "passivity controller" in choices_of(resolve("mapping+pc")).summary
    small = configured(resolve("virtual-proxy+pc"), {"radius": 1e-4}, name="virtual-proxy+pc")(Scene(model=circle()))
    assert 1e-4 <= small.standoff < 1.1e-4


def test_a_promise_of_a_spring_is_taken_back_and_the_others_stay():
    controlled = passivity_controlled(lambda scene: Whatever([]))(Scene(model=circle()))
    assert controlled.declares == Declaration(force_resolution=1e-3)
    assert controlled.standoff == 1e-4


class Feels(Whatever):
    """Asks for the hand's force, and reports a contact where that pushes."""

    contact = False

    def observe_force(self, push):
        self.contact = bool(push.any())


def test_it_feels_and_reports_a_contact_where_the_inner_renderer_does():
    scene = Scene(model=circle(), effects=(ForceSensor(),))
    silent = make_renderer(passivity_controlled(lambda scene: Whatever([])), Scene(model=circle()))
    assert not silent.observes_force
    assert not silent.reports_contact
    with pytest.raises(RefusalError):
        make_renderer(passivity_controlled(lambda scene: Whatever([])), scene)
    feeling = make_renderer(passivity_controlled(lambda scene: Feels([])), scene)
    assert feeling.contact is False
    feeling.observe_force(np.array([0.0, 1.0]))
    assert feeling.contact is True


def test_a_tool_with_physics_of_its_own_and_an_unknown_modifier_are_refused(refused):
    with refused(RefusalError):
        resolve("ideal+pc")(Scene(model=circle()))
    with pytest.raises(UnknownNameError):
        resolve("constraint+pp+cp")
