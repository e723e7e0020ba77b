"""Draw the pictures of docs/continuous-and-passive.md into `pictures`, and print their numbers."""

from pathlib import Path

import numpy as np

from hapticeval.discovery import resolve
from hapticeval.errors import InputError
from hapticeval.examples.studies.energy_field import energy_field, worst_loop
from hapticeval.geometry.catalogue import cassinian
from hapticeval.reports.canvas import figure
from hapticeval.scene import Scene
from hapticeval.simulation.playback import answers_along

PICTURES = Path("pictures")
PICTURES.mkdir(exist_ok=True)
NAMES = ("conformal", "mapping", "homothetic", "combescure")
COLOURS = dict(zip(NAMES, ("#d55e00", "#cc79a7", "#0072b2", "#009e73"), strict=True))
RADIUS, CELL, NOTHING = 4e-3, 1e-3, 1e-9
MODEL = cassinian()
OUTLINE = 1e3 * MODEL.curve.outline(600)
renderers = {name: resolve(name)(Scene(model=MODEL)) for name in NAMES}
fields = {name: energy_field(each, MODEL.curve, cell=CELL) for name, each in renderers.items()}


def bare(axes, title):
    """Draw the model's outline alone."""
    axes.set_title(title, fontsize=9)
    axes.set_aspect("equal")
    axes.plot(*OUTLINE.T, color="#1c1f23", linewidth=1.0)
    axes.set_axis_off()


with figure(11.0, 3.4, layout="constrained") as made:
    panels = made.subplots(1, 4, width_ratios=[1, 1, 1, 1.4])
    for axes, name in zip(panels, ("conformal", "mapping", "combescure"), strict=False):
        field, loop = fields[name], worst_loop(renderers[name], fields[name], RADIUS)
        x, y = 1e3 * field.centres[..., 0], 1e3 * field.centres[..., 1]
        edges = (x[0, 0] - 0.5, x[0, -1] + 0.5, y[0, 0] - 0.5, y[-1, 0] + 0.5)
        shown = axes.imshow(
            1e-3 * field.curl, extent=edges, origin="lower", cmap="RdBu_r", vmin=-6.0, vmax=6.0, interpolation="nearest"
        )
        gained = 1e3 * abs(loop.work)
        bare(axes, f"{name}: worst loop {f'{gained:.3g}' if gained > NOTHING else 'below 1e-9'} mJ")
        turn = np.linspace(0.0, 2.0 * np.pi, 60)
        ring = 1e3 * (np.array(loop.centre)[:, np.newaxis] + RADIUS * np.array([np.cos(turn), np.sin(turn)]))
        axes.plot(*ring, color="#1c1f23", linewidth=1.2)
        print(f"{name}: {1e3 * loop.work:.3g} mJ round {loop.centre}")
    made.colorbar(shown, ax=list(panels[:3]), label="curl of F (kN/m)", shrink=0.7)
    for name in NAMES:
        depths, most = np.arange(5e-3, 55e-3, 5e-3), []
        for depth in depths:
            near = (depth - 1e-3, depth + 1e-3)
            try:
                most.append(1e3 * abs(worst_loop(renderers[name], fields[name], RADIUS, depths=near).work))
            except InputError:
                most.append(np.nan)
        panels[3].semilogy(1e3 * depths, np.maximum(most, NOTHING), "o-", markersize=3, color=COLOURS[name], label=name)
        print(name, dict(zip((1e3 * depths).round().tolist(), np.round(most, 6).tolist(), strict=True)))
    panels[3].set(
        xlabel="depth of the loop's centre (mm)", ylabel="work round the worst loop (mJ, from 1e-9)", ylim=(1e-10, 1e3)
    )
    panels[3].legend(fontsize=8)
    made.savefig(PICTURES / "energy-field.svg", format="svg", metadata={"Date": None})

with figure(10.0, 3.6, layout="constrained") as made:
    panels = made.subplots(1, 3)
    us = np.linspace(0.0, 2.0 * np.pi, 721)
    places, normals = MODEL.curve.position(us), MODEL.curve.normal(us)
    for axes, name in zip(panels, ("homothetic", "combescure"), strict=False):
        support, reach, *centre = renderers[name].projection.potential
        h = np.sum(normals * (places - centre), axis=1)
        for t in np.linspace(0.1, 0.9, 9) * support:
            b = 0.0
            if reach > 0.0:
                x = np.clip((t / reach - 0.5) / 0.5, 0.0, 1.0)
                b = t if t < 0.5 * reach else 0.5 * reach * (1.0 + x - x**3 + 0.5 * x**4)
            a = (support - t) / (support - b)
            axes.plot(*(1e3 * (centre + a * (places - centre - b * normals))).T, color=COLOURS[name], linewidth=0.8)
        bare(axes, f"{name}: level curves")
    for name in ("minimum-distance", "homothetic", "combescure"):
        renderer = resolve(name)(Scene(model=MODEL))
        for u, line in ((0.0, "-"), (np.pi / 4.0, "--")):
            foot, normal = MODEL.curve.position(u), MODEL.curve.normal(u)
            depth = np.linspace(1e-4, 0.04, 120)
            forces = answers_along(renderer, foot - depth[:, np.newaxis] * normal, 1e-3).force
            panels[2].plot(
                1e3 * depth, np.linalg.norm(forces, axis=1) / (1e3 * depth), line,
                color=COLOURS.get(name, "#6b7280"), label=f"{name}, {'tip' if u == 0.0 else 'valley'}",
            )  # fmt: skip
    panels[2].set(xlabel="depth (mm)", ylabel="force over depth (N/mm)", ylim=(0.0, 2.2))
    panels[2].legend(fontsize=7)
    made.savefig(PICTURES / "level-curves.svg", format="svg", metadata={"Date": None})
