"""Judge a renderer of your own from Python, look at what failed and where, mend it, and compare.

Run it as `python examples/judge_a_renderer.py`. It writes no files but the picture.
"""

import sys

import numpy as np

import hapticeval

CASES = ["star-convex-corner", "cassinian-shallow-slide"]


class Nearest:
    """Take the surface point nearest to the hand: simple, and it jumps where two points are equally near."""

    def __init__(self, scene):
        self.boundary, self.stiffness = scene.model.boundary, scene.stiffness

    def reset(self, hip):
        """Start a run; there is nothing to forget."""

    def step(self, hip, velocity, dt):
        """Answer one hand position with a contact point and a force."""
        foot = self.boundary.closest_point([hip])
        ihip = foot.foot[0] if foot.distance[0] < 0.0 else hip
        return hapticeval.Response(ihip, self.stiffness * (ihip - hip))


class Sliding(Nearest):
    """Move the contact point along the surface in small steps towards the hand, and let go where the hand pulls."""

    def reset(self, hip):
        """Start without a contact."""
        self.ihip = None

    def step(self, hip, velocity, dt):
        """Slide from the last contact point in the tangential direction, landing on the surface after each step."""
        if self.ihip is None:
            here = self.boundary.closest_point([hip])
            if here.distance[0] >= 0.0:
                return hapticeval.Response(hip, 0.0 * hip)
            self.ihip = here.foot[0]
        for _ in range(20):
            normal = self.boundary.closest_point([self.ihip]).normal[0]
            along = hip - self.ihip - ((hip - self.ihip) @ normal) * normal
            size = np.linalg.norm(along)
            if size < 1e-7:
                break
            self.ihip = self.boundary.closest_point([self.ihip + along * min(1.0, 2e-4 / size)]).foot[0]
        ihip = self.ihip
        if (hip - ihip) @ normal > 0.0:
            self.ihip, ihip = None, hip
        return hapticeval.Response(ihip, self.stiffness * (ihip - hip))


def main(picture: str = "judged.png") -> hapticeval.Results:
    """Judge both, and draw the case that tells them apart."""
    results = hapticeval.run([Nearest, Sliding], select=CASES)
    frame = results.frame()
    print(frame.pivot_table("outcome", ["case", "check"], "renderer", aggfunc="first").to_string())
    for failed in frame[frame.outcome == "fail"].itertuples():
        print(f"\n{failed.renderer} on {failed.case}, {failed.check}: {failed.message}")
    results.plot("star-convex-corner", "Nearest").savefig(picture)
    return results


if __name__ == "__main__":
    main(*sys.argv[1:])
