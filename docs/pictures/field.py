"""Draw into `pictures` what each renderer of the field does over the tip of a star and over the edge of a cube."""

from pathlib import Path

import numpy as np

from hapticeval.discovery import FIELD, known_renderers, resolve
from hapticeval.reports.canvas import INK, MM, QUIET, THEME, figure
from hapticeval.reports.run_figure import clearest_coordinates
from hapticeval.runner.judging import judge
from hapticeval.suite.reading import load_suite

PICTURES = Path("pictures")
PICTURES.mkdir(exist_ok=True)

NAMES = sorted(name for name, entry in known_renderers().items() if entry.group == FIELD)
CASES = (("thesis", "star-convex-corner", "the tip of the star"), ("solids", "cube-edge", "an edge of the cube"))

for name in NAMES:
    with figure(7.0, 3.2) as made:
        for place, (suite, case_name, title) in enumerate(CASES, 1):
            case = load_suite(suite).case(case_name)
            recording = judge(resolve(name), name, suite, case).recording
            boundary = case.build_scene().model.boundary
            # A path in space is seen in the plane in which it spreads most, and the solid cut there.
            shown = list(clearest_coordinates([recording]))
            middle = 0.5 * (recording.hip.max(axis=0) + recording.hip.min(axis=0))
            paths = np.concatenate([recording.hip, recording.ihip])[:, shown]
            half = 0.6 * float(np.ptp(paths, axis=0).max())
            centre = 0.5 * (paths.max(axis=0) + paths.min(axis=0))
            grid = np.linspace(-half, half, 301)
            points = np.tile(middle, (grid.size, grid.size, 1))
            points[..., shown[0]] = centre[0] + grid
            points[..., shown[1]] = centre[1] + grid[:, np.newaxis]
            distances = boundary.signed_distance(points.reshape(-1, recording.dimension)).reshape(grid.size, -1)
            axes = made.add_subplot(1, 2, place, aspect="equal")
            first, second = (MM * (middle + grid) for middle in centre)
            axes.contourf(first, second, distances, levels=[-np.inf, 0.0], colors=["0.92"])
            axes.contour(first, second, distances, levels=[0.0], colors=[QUIET])
            axes.plot(*(MM * recording.hip[:, shown]).T, "--", color=THEME["hip"], linewidth=1.0, label="HIP")
            axes.plot(*(MM * recording.ihip[:, shown]).T, color=THEME["ihip"], linewidth=1.4, label="IHIP")
            every = slice(None, None, max(len(recording) // 12, 1))
            # From the hand to its contact point: the way that the force pushes it.
            for hip, ihip in zip(recording.hip[every, shown], recording.ihip[every, shown], strict=True):
                axes.plot(*(MM * np.stack([hip, ihip])).T, color=THEME["ray"], linewidth=0.7)
            labels = [f"{'xyz'[axis]} (mm)" for axis in shown]
            axes.set(xlabel=labels[0], ylabel=labels[1])
            axes.set_title(f"{name}: {title}", color=INK)
        axes.legend(frameon=False)
        made.tight_layout()
        made.savefig(PICTURES / f"field-{name}.svg", format="svg", metadata={"Date": None})
