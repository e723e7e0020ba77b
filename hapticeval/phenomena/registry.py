"""All checks by id: the phenomena in the order of thesis section 3.2, then what Problem 7.1 asks for."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from hapticeval.phenomena import (
    abrupt_switch,
    broken_contact,
    centripetal_force,
    closed_form,
    constraint_stability,
    contact_kept,
    contact_normal_force,
    continuous_contact,
    decoupling,
    force_magnitude,
    impulsive_collision,
    memoryless,
    output_invariance,
    passivity,
    reset_clears,
    tangential_dynamics,
)
from hapticeval.phenomena.check import Check

CHECKS: Mapping[str, Check] = MappingProxyType(
    {
        module.CHECK.id: module.CHECK
        for module in (
            continuous_contact,
            contact_kept,
            contact_normal_force,
            broken_contact,
            abrupt_switch,
            impulsive_collision,
            centripetal_force,
            memoryless,
            force_magnitude,
            passivity,
            reset_clears,
            constraint_stability,
            output_invariance,
            decoupling,
            tangential_dynamics,
            closed_form,
        )
    }
)
"""Every check that a suite may name."""

HELD = tuple(
    module.CHECK.id
    for module in (constraint_stability, output_invariance, decoupling, tangential_dynamics, closed_form)
)
"""What Problem 7.1 asks of a closed loop that a surface holds from both sides."""
