"""Figures for papers of studies: every mark has its key, in fonts that journals take."""

import pytest
from matplotlib.colors import to_hex
from reports_synthetic import synthetic_results

from hapticeval.errors import InputError, UnknownNameError
from hapticeval.reports.grid import Grid, phenomenon_grid
from hapticeval.reports.paper import paper_accuracy, paper_grid
from hapticeval.study.bench.document import BenchResults, SettingEntry, Times


def bench(*settings):
    return BenchResults(
        complete=True, reason=None, quick=True, seed=1, rounds=8, environment={}, machine={}, command={},
        references=[], settings=list(settings), orders=[], answers=[], timing={},
    )  # fmt: skip


def setting(renderer, time=2e-6, error=2e-5, **changes):
    times = Times(median=time, p99=time, rounds=[time])
    errors = {name: dict.fromkeys(("rms", "p99", "max"), error) for name in ("ihip", "normal", "force")}
    given = {
        "renderer": renderer, "model": "circle", "settings": {}, "label": renderer, "errors": errors, "claims": errors,
        "proven": True, "step": times, "memory_bytes": 1, "build_seconds": [], "key": renderer,
        "front": False, "problem": None,
    }  # fmt: skip
    return SettingEntry(**{**given, **changes})


def key_of(fig):
    return [text.get_text() for text in fig.legends[0].get_texts()]


def test_a_bench_names_every_renderer_and_what_hollow_means(tmp_path):
    fig = paper_accuracy(bench(setting("a@curve"), setting("b", 3e-6, 1e-6, proven=False)), width="88mm")
    assert key_of(fig) == ["a@curve", "b", "hollow: an upper bound"]
    fig.savefig(tmp_path / "bench.pdf")
    assert b"/Type3" not in (tmp_path / "bench.pdf").read_bytes()
    assert "hollow: an upper bound" not in key_of(paper_accuracy(bench(setting("a@curve"))))


def test_a_renderer_has_a_panel_with_a_line_a_representation_on_axes_that_all_share():
    given = bench(setting("a@x", 1e-6), setting("a@y", 2e-6), setting("b", 3e-6), setting("c", 4e-6, 1e-4))
    panels = paper_accuracy(given).axes
    assert [axes.get_title(loc="left") for axes in panels[:3]] == ["a, circle", "b, circle", "c, circle"]
    drawn = [
        [float(line.get_xdata()[0]) for line in axes.lines if line.get_marker() not in ("", "None")]
        for axes in panels[:3]
    ]
    assert drawn == [pytest.approx([1.0, 2.0]), pytest.approx([3.0]), pytest.approx([4.0])]
    assert len({(axes.get_xlim(), axes.get_ylim()) for axes in panels[:3]}) == 1
    assert not panels[3].axison, "three panels of four"


def test_a_renderer_is_named_with_or_without_its_representation(refused):
    given = bench(setting("a@curve"), setting("a@lut"), setting("b"))
    assert key_of(paper_accuracy(given, ["a"]))[:2] == ["a@curve", "a@lut"]
    assert key_of(paper_accuracy(given, ["a@lut"]))[:2] == ["a@lut"]
    assert key_of(paper_accuracy(given, ["a@lut"], labels={"a@lut": "table"}))[:2] == ["table"]
    with pytest.raises(UnknownNameError):
        paper_accuracy(given, ["c"])
    with refused(InputError):
        paper_accuracy(bench(setting("a", claims=None)))


def test_a_grid_has_a_sign_a_cell_and_the_key_of_each(refused, tmp_path):
    grid = phenomenon_grid(synthetic_results())
    fig = paper_grid(grid)
    signs = {tile.standing.symbol for _, tiles in grid.rows for tile in tiles if tile}
    assert {text.get_text() for text in fig.axes[0].texts} == signs
    assert len(key_of(fig)) == len(signs)
    fig.draw_without_rendering()
    box, inside = fig.axes[0].get_tightbbox(), fig.bbox.padded(1.0)
    assert (inside.x0 <= box.x0, inside.y0 <= box.y0, box.x1 <= inside.x1, box.y1 <= inside.y1) == (True,) * 4
    (tmp_path / "x").mkdir()
    fig.savefig(tmp_path / "grid.pdf")
    assert b"/Type3" not in (tmp_path / "grid.pdf").read_bytes()
    name = grid.rows[0][0]
    assert [label.get_text() for label in paper_grid(grid, [name]).axes[0].get_yticklabels()] == [name]
    with pytest.raises(UnknownNameError):
        paper_grid(grid, ["absent"])
    with refused(InputError):
        paper_grid(Grid([], []))


def test_darker_is_worse():
    fig = paper_grid(phenomenon_grid(synthetic_results()))
    shades = {to_hex(patch.get_facecolor()[0]) for patch in fig.axes[0].collections}
    assert len(shades) >= 2
