"""What the tests of look-up tables in space tabulate."""

import numpy as np

from hapticeval.renderers.tabulated import Source


def sphere(radius):
    """Minimum distance on a sphere about the origin; at its centre any direction is as good."""

    def project(points):
        far = np.linalg.norm(points, axis=1, keepdims=True)
        rays = np.divide(points, far, out=np.tile((1.0, 0.0, 0.0), (len(points), 1)), where=far > 0.0)
        return radius * rays, rays

    return Source(project=project, distance=lambda points: np.linalg.norm(points, axis=1) - radius)
