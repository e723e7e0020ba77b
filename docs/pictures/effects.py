"""Draw the pictures of docs/effects.md into `pictures`, as the report draws them."""

from pathlib import Path
from tempfile import TemporaryDirectory

import hapticeval
from hapticeval.reports.canvas import figure
from hapticeval.reports.effects_figure import (
    PANEL_AREA,
    PANEL_HEIGHT,
    PANEL_WIDTH,
    draw_effect,
    effects_alone,
    read_run,
)

PICTURES = Path("pictures")
PICTURES.mkdir(exist_ok=True)

with TemporaryDirectory() as folder:
    results = hapticeval.run("minimum-distance", suites="effects", output=folder)
    for effect, run in effects_alone(results.document):
        with figure(PANEL_WIDTH, PANEL_HEIGHT) as made:
            draw_effect(made.add_axes(PANEL_AREA), effect, *read_run(Path(folder), run))
            made.savefig(PICTURES / f"{effect.kind}.svg", format="svg", metadata={"Date": None})
        print(f"{effect.kind}.svg: {run.renderer} in {run.suite}/{run.case}")
