"""Draw into `pictures` the smallest paths by which `search --dimension 3` breaks two projections on solids."""

from pathlib import Path

import numpy as np

from hapticeval.discovery import resolve
from hapticeval.reports.canvas import INK, MM, QUIET, THEME, figure
from hapticeval.runner.judging import judge
from hapticeval.stimulus.moves import Move, Moves
from hapticeval.suite.case import Case

PICTURES = Path("pictures")
PICTURES.mkdir(exist_ok=True)

SMALLEST = {
    "minimum-distance": (
        "continuous-contact",
        {"kind": "cube"},
        [[-0.049, 0.051, 0.006], [-0.05, 0.049, 0.006]],
        0.045,
    ),
    "constraint": ("memoryless", {"kind": "l-block"}, [[-0.014, 0.039, 0.051], [-0.013, 0.039, 0.047]], 0.082),
}
"""By renderer: the check, the model, both ends of the path (m), and how long it takes (s)."""


def judged(renderer):
    """Judge the renderer on its path; the check fails there, and of a god-object by what it declares."""
    check, model, (start, end), seconds = SMALLEST[renderer]
    moves = Moves(start=start, moves=(Move(to=end, seconds=seconds, even=True),))
    case = Case(name="smallest", title="smallest", model=model, checks=(check,), trajectory=moves)
    answer = judge(resolve(renderer), renderer, "gallery", case)
    assert answer.verdicts[0].outcome == "fail", answer.verdicts[0].finding.message
    return case.build_scene().model.boundary, answer.recording, answer.verdicts[0]


with figure(7.0, 3.4) as made:
    for place, renderer in enumerate(SMALLEST, 1):
        mesh, recording, verdict = judged(renderer)
        # Both paths lie in a plane square to an axis: the solid is cut there, in a box of 3 mm about the path.
        (across,) = np.flatnonzero(np.ptp(recording.hip, axis=0) == 0.0)
        axes_shown = [axis for axis in range(3) if axis != across]
        middle, grid = recording.hip.mean(axis=0), np.linspace(-3e-3, 3e-3, 201)
        points = np.tile(middle, (grid.size, grid.size, 1))
        points[..., axes_shown[0]] += grid
        points[..., axes_shown[1]] += grid[:, np.newaxis]
        distances = mesh.signed_distance(points.reshape(-1, 3)).reshape(grid.size, grid.size)
        axes = made.add_subplot(1, 2, place, aspect="equal")
        first, second = (MM * (middle[axis] + grid) for axis in axes_shown)
        axes.contourf(first, second, distances, levels=[-1.0, 0.0], colors=["0.92"])
        axes.contour(first, second, distances, levels=[0.0], colors=[QUIET])
        for channel, color in (("hip", THEME["hip"]), ("ihip", THEME["ihip"])):
            path = MM * recording.channel(channel)[:, axes_shown]
            axes.plot(*path.T, ".-", color=color, markersize=3, label=channel.upper())
        axes.set(xlabel=f"{'xyz'[axes_shown[0]]} (mm)", ylabel=f"{'xyz'[axes_shown[1]]} (mm)")
        axes.set_title(f"{renderer}: {verdict.check}", color=INK)
    axes.legend(frameon=False)
    made.tight_layout()
    made.savefig(PICTURES / "smallest-in-space.svg", format="svg", metadata={"Date": None})
