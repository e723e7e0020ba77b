"""Pictures of flows, drawn through the program."""

from __future__ import annotations

import pytest

from hapticeval.examples.studies.flow import main


def test_a_flow_is_drawn_with_its_levels_and_lines(tmp_path, capsys):
    assert main(["circle", "--cells", "40", "-o", str(tmp_path)]) == 0
    svg = (tmp_path / "flow-arc-flow-of-circle.svg").read_text()
    assert "levels" in svg
    assert "transversal lines" in svg
    assert (tmp_path / "flow-arc-flow-of-circle.png").stat().st_size > 10_000
    assert "628.2 mm of outline" in capsys.readouterr().out  # of the 80-gon: 160 r sin(pi / 80)


def test_the_same_flow_gives_the_same_picture(tmp_path):
    for name in ("a", "b"):
        assert main(["circle", "--cells", "30", "-o", str(tmp_path / name)]) == 0
    first, second = ((tmp_path / name / "flow-arc-flow-of-circle.svg").read_bytes() for name in ("a", "b"))
    assert first == second


def test_a_model_without_a_flow_is_drawn_with_a_cross(tmp_path, capsys):
    assert main(["ellipse:ratio=8", "--cells", "60", "-o", str(tmp_path)]) == 2
    assert "no map: here" in (tmp_path / "flow-arc-flow-of-ellipse-ratio-8.svg").read_text()
    assert "conformal" in capsys.readouterr().err


@pytest.mark.parametrize("arguments", [["circel"], ["circle", "--velocity", "ark"], ["line"]])
def test_what_cannot_flow_is_refused(tmp_path, capsys, arguments):
    assert main([*arguments, "-o", str(tmp_path)]) == 2
    assert "what to do" in capsys.readouterr().err or arguments == ["line"]
