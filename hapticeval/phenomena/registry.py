"""All checks by id: the phenomena in the order of thesis section 3.2, what Problem 7.1 asks for, and those of others.

A package adds a check by an entry point of the group `hapticeval.checks`: its name is the check's id, its value a
`Check`.

Ours are listed here instead, for looking through the installed packages takes 20 ms of every process: that is done only
for an id that is not ours, and to list all.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from importlib.metadata import EntryPoint, entry_points

from hapticeval.errors import InputError, describe_error
from hapticeval.phenomena import (
    answers_again,
    centripetal_force,
    closed_form,
    comes_to_rest,
    constraint_stability,
    contact_kept,
    contact_normal_force,
    continuous_contact,
    corners,
    drift,
    force_magnitude,
    impulsive_collision,
    metamorphic,
    numerical_stability,
    passivity,
    surface_dynamics,
)
from hapticeval.phenomena.check import Check
from hapticeval.phenomena.effects import (
    friction_break_away,
    friction_cone,
    friction_energy,
    friction_force,
    friction_sliding,
    friction_sticking,
    friction_work,
    order,
    relief,
    shading,
    texture,
    texture_work,
    transient,
)
from hapticeval.phenomena.pages import read_page

GROUP = "hapticeval.checks"

OF_EFFECTS: Mapping[str, Check] = {
    check.id: check
    for check in (
        *shading.CHECKS,
        *texture.CHECKS,
        texture_work.CHECK,
        relief.CHECK,
        friction_cone.CHECK,
        friction_break_away.CHECK,
        friction_sticking.CHECK,
        friction_sliding.CHECK,
        friction_force.CHECK,
        friction_energy.CHECK,
        friction_work.CHECK,
        *transient.CHECKS,
        order.CHECK,
    )
}
"""Those that ask whether an effect is shown, which a scene has to call for."""

OWN: Mapping[str, Check] = {
    check.id: check
    for check in (
        continuous_contact.CHECK,
        contact_kept.CHECK,
        contact_normal_force.CHECK,
        corners.BROKEN_CONTACT,
        corners.ABRUPT_SWITCH,
        impulsive_collision.CHECK,
        centripetal_force.CHECK,
        answers_again.MEMORYLESS,
        force_magnitude.CHECK,
        passivity.CHECK,
        answers_again.RESET_CLEARS,
        constraint_stability.CHECK,
        *surface_dynamics.CHECKS,
        closed_form.CHECK,
        comes_to_rest.CHECK,
        numerical_stability.CHECK,
        drift.CHECK,
        *metamorphic.CHECKS,
        *OF_EFFECTS.values(),
    )
}
"""The checks of this package."""


class Checks(Mapping[str, Check]):
    """Checks by id, ours first. Looking up an installed one that cannot be loaded raises `InputError`."""

    def __getitem__(self, name: str) -> Check:
        # Ours first: the installed packages are looked through for other names only (20 ms).
        return OWN[name] if name in OWN else _loaded(_installed()[name])

    def __contains__(self, name: object) -> bool:
        return name in OWN or name in _installed()

    def __iter__(self) -> Iterator[str]:
        yield from OWN
        yield from _installed()

    def __len__(self) -> int:
        return len(OWN) + len(_installed())


def _installed() -> Mapping[str, EntryPoint]:
    """Return the entry points of others by name, in alphabetical order; none may replace a check of ours."""
    entries = sorted(entry_points(group=GROUP), key=lambda entry: entry.name)
    # An installed check of the name of one of ours is left out: a verdict's meaning is not to be replaced.
    return {entry.name: entry for entry in entries if entry.name not in OWN}


def _loaded(entry: EntryPoint) -> Check:
    """Import the check of an entry point; raises `InputError` where that fails or gives something else."""
    try:
        check = entry.load()
    # A package of others may raise anything while it is imported.
    except Exception as error:
        why = describe_error(error)
    else:
        if isinstance(check, Check) and check.id == entry.name:
            read_page(check)  # one that cannot say what it asks is refused before it judges
            return check
        why = f"it is the check '{check.id}'" if isinstance(check, Check) else f"it is a {type(check).__name__}"
    package = "" if entry.dist is None else f" of the package {entry.dist.name}"
    raise InputError(
        f"the check '{entry.name}'{package} cannot be loaded from {entry.value}",
        why=why,
        todo=f"mend or remove that package; an entry point of {GROUP} names a Check with its id",
    )


CHECKS: Mapping[str, Check] = Checks()
"""Every check that a suite may name."""
