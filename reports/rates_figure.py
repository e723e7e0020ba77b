"""What a faster loop buys, as a picture: a panel per phenomenon, and the largest stable stiffness."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from hapticeval.reports.canvas import CURVES, colour_of, figure, save_figure

MARKERS = ("o", "s", "^", "D", "v", "P", "X")
"""One marker for each renderer, in turns."""

SMALLEST_SHARE = 1e-7
"""Share of the largest value at which nothing, which no logarithm reaches, is drawn."""


def write_rates(directory: Path, document: Mapping[str, Any]) -> list[Path]:
    """Draw the document of `study_rates` into `directory` as SVG and PNG, with the numbers as JSON.

    Return the paths written. Raises `HapticevalError` where a file cannot be written.
    """
    names = list(dict.fromkeys(row["renderer"] for row in document["rows"]))
    checks = list(document["cases"])
    with figure(13.0, 3.4 * ((len(checks) + 1 + 3) // 4), layout="constrained") as fig:
        panels = fig.subplots((len(checks) + 1 + 3) // 4, 4).ravel()
        for axes, check in zip(panels, checks, strict=False):
            check_rows = [row for row in document["rows"] if row["check"] == check and "metric" in row]
            # 1 where nothing was measured or all is zero: a logarithmic axis needs some scale.
            top = max((row["metric"]["value"] for row in check_rows), default=1.0) or 1.0
            for k, name in enumerate(names):
                rows_of_curve = [row for row in check_rows if row["renderer"] == name]
                if rows_of_curve:
                    values = [max(row["metric"]["value"], SMALLEST_SHARE * top) for row in rows_of_curve]
                    axes.plot(
                        [row["rate"] for row in rows_of_curve], values, label=name,
                        color=colour_of(CURVES[k % len(CURVES)]), marker=MARKERS[k % len(MARKERS)], markersize=4,
                        linewidth=1.0,
                    )  # fmt: skip
            unit = check_rows[0]["metric"]["unit"] if check_rows else ""
            axes.set(xscale="log", yscale="log", title=check, ylabel=f"metric ({unit})" if unit else "metric (share)")
            smallest = min((row["metric"]["value"] for row in check_rows), default=top)
            axes.set_ylim(0.5 * max(smallest, SMALLEST_SHARE * top), 3.0 * top)
        # The panel after the checks' has the stiffness; a row of four may have empty ones.
        limit, *unused = panels[len(checks) :]
        rows = document["limit"]["rows"]
        for entry, style in (("stable", "-"), ("passive", "--")):
            # None: no limit was found, and nothing is drawn there.
            rows_of_curve = [row for row in rows if row[entry] is not None]
            limit.plot(
                [row["rate"] for row in rows_of_curve], [row[entry] for row in rows_of_curve], style, label=entry
            )
        limit.set(xscale="log", yscale="log", title="largest stiffness of the robot's loop", ylabel="N/m")
        limit.legend(fontsize=7)
        for axes in panels[: len(checks) + 1]:
            axes.set(xlabel="sampling rate (Hz)", xlim=(0.7 * min(document["rates"]), 1.4 * max(document["rates"])))
            axes.grid(True, which="major")
        for axes in unused:
            axes.remove()
        fig.legend(*panels[0].get_legend_handles_labels(), loc="lower right", fontsize=8)
        return save_figure(fig, directory, "rates", document=document)
