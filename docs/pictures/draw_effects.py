"""Draw the pictures of docs/effects.md from results: `hapticeval run effects -r minimum-distance -o results` first.

python docs/pictures/draw_effects.py results
"""

import sys
from pathlib import Path

from hapticeval.reports.canvas import figure
from hapticeval.reports.effects_figure import HEIGHT, PLACE, WIDTH, draw_effect, recorded, shown_alone
from hapticeval.runner.results import read_results

results = Path(sys.argv[1])
for effect, run in shown_alone(read_results(results)):
    with figure(WIDTH, HEIGHT) as made:
        draw_effect(made.add_axes(PLACE), effect, *recorded(results, run))
        path = Path(__file__).parent / f"{effect.kind}.svg"
        made.savefig(path, format="svg", metadata={"Date": None})
        print(f"{path}: {run.renderer} in {run.suite}/{run.case}")
