"""The ideal rigid contact: the ground truth that verdicts are measured against (thesis (3.1) to (3.8))."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from hapticeval.rigid_contact.contact import Ground, IdealContact
    from hapticeval.scene import Scene


class _Ideal:
    """Makes the ideal rigid contact of a scene. It takes no variants; what it needs is imported on first use."""

    summary = "event-driven rigid, frictionless contact of a point tool: the ground truth"

    def __call__(self, scene: Scene) -> IdealContact:
        from hapticeval.rigid_contact.contact import IdealContact

        return IdealContact(scene, _ground_of(scene))


def _ground_of(scene: Scene) -> Ground:
    """Return a scene's boundary as the ideal contact takes it: a branch a kind of boundary, each in a file of its own.

    Raises `RefusalError` for a boundary of another kind.
    """
    from hapticeval.errors import RefusalError
    from hapticeval.geometry.curve import Curve
    from hapticeval.geometry.mesh import Mesh
    from hapticeval.geometry.surface import Surface

    boundary = scene.model.boundary
    if isinstance(boundary, Curve):
        from hapticeval.rigid_contact.plane_contact import PlaneGround

        return PlaneGround(scene)
    if isinstance(boundary, Mesh):
        from hapticeval.rigid_contact.mesh_contact import MeshGround

        return MeshGround(scene)
    if isinstance(boundary, Surface):
        from hapticeval.rigid_contact.surface_contact import SurfaceGround

        return SurfaceGround(boundary)
    raise RefusalError(
        f"model '{scene.model.name}' is a {type(boundary).__name__}",
        why="the ideal contact has no search for where the tool slides, leaves and hits on it",
        todo="compare on the model's cross-section, where the corners are those of the extruded solid",
    )


ideal = _Ideal()

__all__ = ["ideal"]
