"""The ideal rigid contact: the ground truth that verdicts are measured against (thesis 3.1 to 3.8)."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from hapticeval.rigid_contact.contact import IdealContact
    from hapticeval.scene import Scene


class _Ideal:
    """Makes the ideal rigid contact of a scene. It takes no variants; what it needs is imported on first use."""

    summary = "event-driven rigid, frictionless contact of a point tool: the ground truth"

    def __call__(self, scene: Scene) -> IdealContact:
        from hapticeval.rigid_contact.contact import IdealContact

        return IdealContact(scene)


ideal = _Ideal()

__all__ = ["ideal"]
