"""All checks by id, in the order of thesis section 3.2."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from hapticeval.phenomena import (
    abrupt_switch,
    broken_contact,
    centripetal_force,
    contact_normal_force,
    continuous_contact,
    impulsive_collision,
    memoryless,
)
from hapticeval.phenomena.check import Check

CHECKS: Mapping[str, Check] = MappingProxyType(
    {
        module.CHECK.id: module.CHECK
        for module in (
            continuous_contact,
            contact_normal_force,
            broken_contact,
            abrupt_switch,
            impulsive_collision,
            centripetal_force,
            memoryless,
        )
    }
)
"""Every check that a suite may name."""
