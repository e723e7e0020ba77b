"""What users of renderers and physics engines report, as renderers of some ten lines that have it, and relatives.

Each is the nearest point and a spring with one fault, written anew from what its thread describes. `BROKEN` and
`HONEST` are as in `outsiders`, and led along `CASES`: those in space of the suites `field` and `seams`. The first check
that one fails is the one that has to name it. The threads in which they were `reported` were read; what is done here is
made from their words, not their code.
"""

from __future__ import annotations

from collections.abc import Mapping

import msgspec
import numpy as np
from honest import Spring, factory
from outsiders import Outsider

from hapticeval.discovery import resolve
from hapticeval.renderer import Response
from hapticeval.renderers.field.passivity_control import passivity_controlled
from hapticeval.scene import Scene
from hapticeval.suite.reading import load_suite

CASES = {
    case.name: case
    for suite in ("field", "seams")
    for case in load_suite(suite).cases
    # the renderers here are for solids
    if case.build_scene().model.dimension == 3
}
# the same where the scene calls for a damper
CASES["press-and-leave-damped"] = msgspec.structs.replace(
    CASES["press-and-leave"], name="press-and-leave-damped", scene={"damping": 5.0}
)


class Faulty(Spring):
    """The nearest point and a spring, with the scene at hand."""

    def __init__(self, scene: Scene) -> None:
        super().__init__(scene)
        self.scene = scene

    def answer(self, ihip: np.ndarray, hip: np.ndarray) -> Response:
        return Response(ihip, self.stiffness * (ihip - hip))


class InternalEdges(Faulty):
    """Near an edge of a triangle the normal is that to a point on the edge, also where the faces are one plane."""

    def step(self, hip, velocity, dt):
        ihip, force = super().step(hip, velocity, dt)
        mesh = self.boundary
        if not force.any():
            return Response(ihip, force)
        corners = mesh.vertices[mesh.triangles]
        starts, ends = corners.reshape(-1, 3), np.roll(corners, -1, axis=1).reshape(-1, 3)
        along = np.clip(np.sum((ihip - starts) * (ends - starts), 1) / np.sum((ends - starts) ** 2, 1), 0.0, 1.0)
        on_edges = starts + along[:, np.newaxis] * (ends - starts)
        nearest = on_edges[np.argmin(np.linalg.norm(on_edges - ihip, axis=1))]
        if np.linalg.norm(nearest - ihip) > 5e-4:
            return Response(ihip, force)
        aside = nearest - hip
        return Response(ihip, np.linalg.norm(force) * aside / np.linalg.norm(aside))


class TriangleByTriangle(Faulty):
    """Each triangle within the depth of the hand pushes by itself, and the forces add up."""

    def step(self, hip, velocity, dt):
        ihip, force = super().step(hip, velocity, dt)
        if not force.any():
            return Response(ihip, force)
        mesh, depth = self.boundary, np.linalg.norm(ihip - hip)
        reach = np.linalg.norm(mesh.vertices[mesh.triangles].mean(axis=1) - ihip, axis=1)
        return Response(ihip, force * max(1, int(np.sum(reach < 0.004 + depth))))


class DepthStops(Faulty):
    """The depth is right until a ball of 5 mm would be inside as a whole, and then stays."""

    def step(self, hip, velocity, dt):
        ihip, force = super().step(hip, velocity, dt)
        return Response(ihip, force * min(1.0, 0.005 / max(float(np.linalg.norm(ihip - hip)), 1e-9)))


class NormalToCorner(Faulty):
    """The direction out leads to the nearest corner where that is near, and the depth is the distance to it."""

    near, every = 0.02, 1

    def reset(self, hip):
        self.asked = 0

    def step(self, hip, velocity, dt):
        ihip, force = super().step(hip, velocity, dt)
        self.asked += 1
        away = self.boundary.vertices - hip
        corner = away[np.argmin(np.linalg.norm(away, axis=1))]
        wrong = force.any() and np.linalg.norm(corner) < self.near and self.asked % self.every == 0
        return Response(ihip, self.stiffness * corner if wrong else force)


class RightOnOccasion(NormalToCorner):
    """The same in every other tick."""

    every = 2


class SixtyHertz(Faulty):
    """IHIP and force are those of the last frame of a loop of 60 Hz."""

    def reset(self, hip):
        self.time, self.due, self.last = 0.0, 0.0, None

    def step(self, hip, velocity, dt):
        if self.last is None or self.time >= self.due:
            self.last, self.due = super().step(hip, velocity, dt), self.due + 1.0 / 60.0
        self.time += dt
        return self.last


class ImpulseForForce(Faulty):
    """The impulse of a tick is sent to the motors as if it were a force."""

    def step(self, hip, velocity, dt):
        ihip, force = super().step(hip, velocity, dt)
        return Response(ihip, dt * force)


class KeepsLastForce(Faulty):
    """Where no position comes in, the last answer stays on."""

    def step(self, hip, velocity, dt):
        if np.isfinite(hip).all():
            self.last = super().step(hip, velocity, dt)
        return self.last


class BothSidesPush(Faulty):
    """Every face of a box within 6 mm pushes by how deep the hand is under it, as if each were the only one."""

    def step(self, hip, velocity, dt):
        ihip, force = super().step(hip, velocity, dt)
        if not force.any():
            return Response(ihip, force)
        lows, highs = np.array(self.boundary.bounds).reshape(2, -1)
        up, down = np.clip(0.0065 - (highs - hip), 0.0, None), np.clip(0.0065 - (hip - lows), 0.0, None)
        return Response(ihip, self.stiffness * (up - down))


class SignByArea(Faulty):
    """Beside an edge the sign is that of one of its faces, as where the larger one outweighs the other in the sum."""

    def step(self, hip, velocity, dt):
        near = self.boundary.closest_point(hip[np.newaxis])
        mesh = self.boundary
        around = np.abs(np.sum((near.foot[0] - mesh.vertices[mesh.triangles[:, 0]]) * mesh.normals, axis=1)) < 1e-9
        inside = near.distance[0] < 0.0
        if near.distance[0] > 0.0 and len(np.unique(np.round(mesh.normals[around], 6), axis=0)) > 1:
            inside = bool(np.any(mesh.normals[around] @ (hip - near.foot[0]) < 0.0))
        return self.answer(near.foot[0], hip) if inside else Response(hip, np.zeros_like(hip))


class JumpsToZero(Faulty):
    """Over 4 N the force jumps between zero and what it should be."""

    def reset(self, hip):
        self.asked = 0

    def step(self, hip, velocity, dt):
        ihip, force = super().step(hip, velocity, dt)
        self.asked += 1
        return Response(ihip, force * (np.linalg.norm(force) < 4.0 or self.asked % 4 < 2))


class PhantomDepth(Faulty):
    """In one tick of 64 the depth has the width of the body added to it."""

    def reset(self, hip):
        self.asked = 0

    def step(self, hip, velocity, dt):
        ihip, force = super().step(hip, velocity, dt)
        self.asked += 1
        depth = float(np.linalg.norm(ihip - hip))
        wide = self.scene.model.size if self.asked % 64 == 0 and depth > 0.0 else 0.0
        return Response(ihip, force * (1.0 + wide / max(depth, 1e-9)))


class SpuriousContact(Faulty):
    """Now and then, for eight ticks in free space near the surface, a contact of 5 N appears."""

    def reset(self, hip):
        self.asked = 0

    def step(self, hip, velocity, dt):
        ihip, force = super().step(hip, velocity, dt)
        self.asked += 1
        near = self.boundary.closest_point(hip[np.newaxis])
        appears = 0.0 < near.distance[0] < 0.0015 and self.asked % 128 < 16
        return Response(ihip, 5.0 * near.normal[0] if appears else force)


class ContactWithMargin(Faulty):
    """The distance is negative from 1.2 mm outside on, and so the force begins there."""

    margin = 0.0012

    def step(self, hip, velocity, dt):
        near = self.boundary.closest_point(hip[np.newaxis])
        depth = self.margin - near.distance[0]
        if depth <= 0.0:
            return Response(hip, np.zeros_like(hip))
        return Response(hip + depth * near.normal[0], self.stiffness * depth * near.normal[0])


class LateToSee(Faulty):
    """A contact is seen from 1.5 mm on, and pushed out of at once from there."""

    def reset(self, hip):
        self.seen = False

    def step(self, hip, velocity, dt):
        ihip, force = super().step(hip, velocity, dt)
        self.seen = force.any() and (self.seen or np.linalg.norm(ihip - hip) > 0.0015)
        return Response(ihip, force) if self.seen else Response(hip, np.zeros_like(hip))


class ForceOfOldContact(Faulty):
    """The force of a contact that is over stands for 40 ticks."""

    def reset(self, hip):
        self.age, self.old = 1000, np.zeros_like(hip)

    def step(self, hip, velocity, dt):
        ihip, force = super().step(hip, velocity, dt)
        self.age = 0 if force.any() else self.age + 1
        self.old = force if force.any() else self.old
        return Response(ihip, self.old if self.age < 40 else force)


class ConvexHull(Faulty):
    """The body is the convex hull of its vertices."""

    def __init__(self, scene):
        super().__init__(scene)
        from scipy.spatial import ConvexHull as Hull

        from hapticeval.geometry.mesh import Mesh

        hull = Hull(scene.model.boundary.vertices)
        corners = hull.points[hull.simplices]
        turned = np.einsum("ij,ij->i", np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]),
                           hull.equations[:, :3]) < 0.0  # fmt: skip
        cells = np.where(turned[:, np.newaxis], hull.simplices[:, ::-1], hull.simplices)
        self.boundary = Mesh("hull", hull.points, cells)


class UnclippedDamper(Faulty):
    """F = K d n - b v, along and across the surface, and negative where the hand leaves."""

    damping = 5.0

    def step(self, hip, velocity, dt):
        ihip, force = super().step(hip, velocity, dt)
        return Response(ihip, force - self.damping * velocity if force.any() else force)


class ClippedDamper(Faulty):
    """Honest: F = max(K d - K_d v . n, 0) n with the scene's damper: clipped where it would draw the hand in."""

    def step(self, hip, velocity, dt):
        ihip, force = super().step(hip, velocity, dt)
        size = float(np.linalg.norm(force))
        outward = force / max(size, 1e-300)
        return Response(ihip, max(size - self.scene.damping * float(velocity @ outward), 0.0) * outward)


class Refusing(Spring):
    """Honest: raises for a position that is none."""

    def step(self, hip, velocity, dt):
        if not np.isfinite(hip).all():
            raise ValueError("the hand's position is missing")
        return super().step(hip, velocity, dt)


class Zeroing(Spring):
    """Honest: gives no force for a position that is none, and goes on."""

    def step(self, hip, velocity, dt):
        missing = not np.isfinite(hip).all()
        return Response(hip, np.zeros_like(hip)) if missing else super().step(hip, velocity, dt)


PRESSED = ("press-and-leave", "steady-push")

STALE = "what is 16 ticks old"
BROKEN: Mapping[str, Outsider] = {
    "internal-edges": Outsider(
        InternalEdges,
        {
            "seams": "other edges, other kicks",
            "contact-normal-force": "a force aside at an edge within a face",
        },
        ("across-many-angles",),
        reported="github.com/bulletphysics/bullet3 issue 288; dimforge/rapier issue 95",
    ),
    "triangle-by-triangle": Outsider(
        TriangleByTriangle,
        {"seams": "as many forces as triangles"},
        ("across-many-angles",),
        reported="github.com/coal-library/coal issue 357",
    ),
    "sixty-hertz": Outsider(
        SixtyHertz,
        {
            "update-rate": "59 Hz in a loop of 1,000 Hz",
            "drop-out": "the last frame's force stays on without a hand",
            "contact-kept": STALE,
            "continuous-contact": STALE,
            "force-magnitude": STALE,
        },
        ("round-a-ball",),
        reported="github.com/sofa-framework/sofa issue 5158",
    ),
    "keeps-last-force": Outsider(
        KeepsLastForce,
        {"drop-out": "the force of the last position stays on"},
        ("press-and-leave",),
        reported="github.com/isaac-sim/IsaacLab pull request 6637, review of haptic_feedback.py",
    ),
    "unclipped-damper": Outsider(
        UnclippedDamper,
        {
            "never-pulls": "b v is more than K d while the hand leaves",
            "contact-normal-force": "inwards, and aside by what damps along the surface",
            "force-magnitude": "the damper is most of it at little depth",
        },
        ("press-and-leave",),
        reported="the formula F = K d n - b v of introductory texts, clipped nowhere",
    ),
    "depth-stops-at-radius": Outsider(
        DepthStops,
        {"force-magnitude": "softer the deeper"},
        ("deep",),
        reported="github.com/google-deepmind/mujoco issue 2206",
    ),
    "impulse-for-force": Outsider(
        ImpulseForForce,
        {"force-magnitude": "a thousandth, dt"},
        ("steady-push",),
        reported="github.com/sofa-framework/sofa pull request 6117",
    ),
    "jumps-to-zero": Outsider(
        JumpsToZero,
        {"force-magnitude": "none in every other pair of ticks"},
        ("steady-push",),
        reported="github.com/raisimTech/raisimLib issue 322",
    ),
    "phantom-depth": Outsider(
        PhantomDepth,
        {"force-magnitude": "100 N in a tick of 64"},
        ("steady-push",),
        reported="github.com/google-deepmind/mujoco issue 3476",
    ),
    "both-sides-push": Outsider(
        BothSidesPush,
        {"force-magnitude": "the far face takes from it"},
        ("plate-pressed",),
        reported="github.com/RobotLocomotion/drake issue 12441",
    ),
    "normal-to-corner": Outsider(
        NormalToCorner,
        {"contact-normal-force": "a normal to the corner"},
        ("beside-a-diagonal",),
        reported="github.com/flexible-collision-library/fcl issue 545",
    ),
    "right-on-occasion": Outsider(
        RightOnOccasion,
        {"contact-normal-force": "the same in every other tick"},
        ("beside-a-diagonal",),
        reported="github.com/flexible-collision-library/fcl issue 76",
    ),
    "sign-by-area": Outsider(
        SignByArea,
        {"contact-kept": "a force outside", "contact-normal-force": "pulls in from outside"},
        ("past-a-fin",),
        reported="github.com/llnl/axom issue 783 and pull request 784",
    ),
    "free-behind-plate": Outsider(
        Spring,
        {"contact-kept": "a hand that passes a plate in a tick is free"},
        ("plate-in-a-tick",),
        reported="github.com/google-deepmind/mujoco issues 441 and 1443",
    ),
    "late-to-see": Outsider(
        LateToSee,
        {"contact-kept": "1.5 mm deep before it is seen"},
        ("steady-push",),
        reported="github.com/NVIDIAGameWorks/PhysX issue 468",
    ),
    "spurious-contact": Outsider(
        SpuriousContact,
        {
            "contact-kept": "5 N in free space",
            "force-magnitude": "a kick where the contact begins",
        },
        ("hover",),
        reported="github.com/raisimTech/raisimLib issue 5",
    ),
    "force-of-old-contact": Outsider(
        ForceOfOldContact,
        {"contact-kept": "a force in free space"},
        ("hover",),
        reported="github.com/newton-physics/newton issue 2885",
    ),
    "contact-with-margin": Outsider(
        ContactWithMargin,
        {"continuous-contact": "1.2 mm off the surface"},
        ("hover",),
        reported="github.com/google-deepmind/mujoco issue 1857",
    ),
    "convex-hull": Outsider(
        ConvexHull,
        {
            "continuous-contact": "the hull's face, 30 mm off",
            "contact-normal-force": "the hull's normal",
            "contact-kept": "the hull fills the notch, and holds a hand that is outside of the model",
        },
        ("in-a-notch",),
        reported="MuJoCo's documentation: a mesh collides as its convex hull",
    ),
}
"""Each fault: what stops it, and why, the check that has to name it first; and where it was reported."""

HONEST: Mapping[str, Outsider] = {
    "held-at-plates": Outsider(resolve("constraint"), cases=("plate-in-a-tick", "in-a-notch", "across-many-angles")),
    "ball-at-edges": Outsider(resolve("virtual-proxy"), cases=("plate-in-a-tick", "past-a-fin", "press-and-leave")),
    "fine-facets": Outsider(resolve("minimum-distance"), cases=("round-a-ball", "normal-equal", "hover")),
    "refuses-nothing": Outsider(Refusing, cases=PRESSED),
    "gives-zero": Outsider(Zeroing, cases=PRESSED),
    "two-ticks-late": Outsider(factory("late-2", Spring), cases=("press-and-leave", "round-a-ball", "steady-push")),
    "stands-off": Outsider(factory("standoff", Spring), cases=("press-and-leave", "hover", "deep")),
    "clipped-damper": Outsider(ClippedDamper, cases=("press-and-leave-damped",)),
    "controlled": Outsider(passivity_controlled(Spring), cases=("press-and-leave", "round-a-ball")),
}
"""Relatives that are right: no check may blame them."""
