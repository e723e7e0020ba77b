"""Draw the pictures of docs/effects.md into `pictures`, of what the report shows."""

from pathlib import Path
from tempfile import TemporaryDirectory

import hapticeval
from hapticeval.reports.canvas import figure
from hapticeval.reports.chart import draw_chart
from hapticeval.reports.effects_figure import effect_chart, effects_alone, read_run

PICTURES = Path("pictures")
PICTURES.mkdir(exist_ok=True)

with TemporaryDirectory() as folder:
    results = hapticeval.run("minimum-distance", suites="effects", output=folder)
    for effect, run in effects_alone(results.document):
        with figure(4.2, 3.0, layout="constrained") as drawing:
            draw_chart(drawing.subplots(), effect_chart(effect, *read_run(Path(folder), run)))
            drawing.savefig(PICTURES / f"{effect.kind}.svg", format="svg", metadata={"Date": None})
        print(f"{effect.kind}.svg: {run.renderer} in {run.suite}/{run.case}")
