"""The comparison of runs as picture, table and document: all of it, and the same each time."""

from __future__ import annotations

import json
import math
import re
import xml.etree.ElementTree as ET

import numpy as np
import pytest

from hapticeval.cli import main
from hapticeval.recordings.compare.align import GRID_POINTS, Abscissa, Run, align
from hapticeval.recordings.compare.permutation import LEVEL, least_p, needed
from hapticeval.recordings.compare.spread import compare
from hapticeval.recordings.hdf5 import write_recording
from hapticeval.recordings.recording import Recording
from hapticeval.reports.spread_figure import summary, table, write_spread

ANGLE = np.linspace(0.2, 2.2, 400)


def recording(seed, *, more=0.0, renderer=None):
    rng = np.random.default_rng(seed)
    size = 2.0 + more + 0.1 * rng.standard_normal() + 0.1 * np.sin(5.0 * ANGLE + rng.uniform(0.0, 6.28))
    outward = np.column_stack([np.cos(ANGLE), np.sin(ANGLE)])
    hip = (0.1 - 1e-3 * size)[:, None] * outward
    meta = {"scene": {"model": {"kind": "circle"}}, **({"renderer": renderer} if renderer else {})}
    return Recording(1e-3 * np.arange(400), {"hip": hip, "ihip": 0.1 * outward, "force": size[:, None] * outward}, meta)


@pytest.fixture(scope="module")
def aligned():
    runs = [
        Run(f"{name}{seed}", name, recording(seed + 10 * k, more=k)) for k, name in enumerate("ab") for seed in range(4)
    ]
    return align(runs, Abscissa("angle"))


def test_everything_is_written_twice_alike(aligned, tmp_path):
    found = compare(aligned)
    first = write_spread(tmp_path / "one", aligned, found)
    again = write_spread(tmp_path / "two", aligned, found)
    assert [path.suffix for path in first] == [".svg", ".png", ".md", ".json"]
    for one, two in zip(first, again, strict=True):
        assert one.read_bytes() == two.read_bytes()
    words = " ".join(ET.parse(first[0]).getroot().itertext())
    for expected in ("direction of the force", "size of the force", "a (4 repeats)", "b (4 repeats)", "degrees"):
        assert expected in words
    document = json.loads(first[3].read_text())
    assert document["by"] == "angle"
    assert len(document["grid"]) == GRID_POINTS
    outcomes = {each["column"]: each["outcome"] for each in document["comparisons"]}
    assert outcomes["direction"] == "the same to rounding"
    assert set(outcomes.values()) <= {"differs", "within the spread", "the same to rounding"}
    assert len(document["passes"]) == 8


def test_the_table_states_each_difference_in_spreads(aligned):
    text = table(aligned, compare(aligned))
    size = re.search(r"a and b, forward, size of the force: differs by (\S+) N, which is (\S+) times the repeat", text)
    assert size is not None
    assert float(size[1]) == pytest.approx(1.0, abs=0.2)
    assert float(size[2]) > 3.0
    assert "a and b, forward, direction of the force: the same to rounding: 9.3e-05 degrees apart at most" in text
    assert len(re.findall(r"\| [ab] \| [ab]\d \| forward \| 1 \| \S+ \| \S+ \| (?:9\d\.?\d*|100) % \|", text)) == 8
    assert "takes two renderers" in table(aligned, ())


def test_repeats_that_do_not_differ_are_no_spread_to_divide_by():
    one = recording(1)
    runs = []
    for name, more in (("a", 0.0), ("b", 0.1)):
        for k in range(4):
            hip = one.hip.copy()
            hip[15 + k] *= 2.0  # no copy, and at the same angle to the bit
            runs.append(Run(f"{name}{k}", name, Recording(one.time, {"hip": hip, "force": one.force * (1.0 + more)})))
    apart = align(runs, Abscissa("angle"))
    text = table(apart, [each for each in compare(apart) if each.column == "magnitude"])
    assert re.search(r"size of the force: differs by \S+ N, where repeats do not differ at all \(p = 0.029", text)
    assert "inf" not in text


def test_a_row_a_run_says_what_its_passes_cover_together():
    there = recording(1)
    turn = np.concatenate([np.arange(400), np.arange(398, -1, -1), np.arange(1, 201)])
    channels = {name: values[turn] for name, values in there.channels.items()}
    to_and_fro = Run("a0", "a", Recording(1e-3 * np.arange(turn.size), channels))
    rows = summary(align([to_and_fro, Run("b0", "b", there)], Abscissa("angle"), split=True), ()).splitlines()[2:]
    assert rows[0] == "| renderer | run | covered forward | covered backward |"
    assert re.fullmatch(r"\| a \| a0 \| (99.*|100) % in 2 passes \| (99.*|100) % \|", rows[2])
    assert re.fullmatch(r"\| b \| b0 \| (99.*|100) % \|  \|", rows[3])


def files(folder, *names):
    out = []
    for k, name in enumerate(names):
        path = folder / f"{k}.h5"
        write_recording(path, recording(k, more=1.0 if name == "b" else 0.0, renderer=name))
        out.append(str(path))
    return out


def test_the_command_compares_and_writes(tmp_path, capsys):
    given = files(tmp_path, *"aaaabbbb")
    assert main(["compare", *given, "--by", "arc", "-o", str(tmp_path / "out")]) == 0
    said = capsys.readouterr().out
    assert said.index("differs by") < said.index("| renderer |"), "what matters comes first"
    rows = re.findall(r"^\| [ab] \| \S+ \| \S+ % \|  \|$", said, re.MULTILINE)
    assert len(rows) == 8, "a row a run, that went one way"
    assert (tmp_path / "out" / "comparison.png").exists()
    assert json.loads((tmp_path / "out" / "comparison.json").read_text())["by"] == "arc"


def test_too_few_repeats_are_told_with_how_many_it_takes(tmp_path, capsys):
    assert main(["compare", *files(tmp_path, *"aabbb"), "-o", str(tmp_path / "out")]) == 0
    said = capsys.readouterr().out
    assert "too few repeats" in said
    assert "given are 2 of a and 3 of b; it takes 2 more of a at the least (4 and 3)" in said


def test_the_help_says_how_many_repeats_it_takes(capsys):
    assert main(["compare", "--help"]) == 0
    said = " ".join(capsys.readouterr().out.split())
    (ways, twins), total = (math.comb(8, 4), 2), needed(1, 1, tests=1, level=LEVEL)
    assert f"4 and 4 repeats are dealt to two renderers in {ways} ways, of which {twins} part them" in said
    assert least_p(4, 4) == twins / ways
    assert total == (4, 3)
    assert "4 and 3 are the fewest that can tell" in said
    assert needed(1, 1, tests=2, level=LEVEL) == needed(2, 2, tests=2, level=LEVEL) == (5, 3)
    assert needed(4, 4, tests=2, level=LEVEL) == (5, 4)
    assert "5 and 3 are the fewest, and beside 4 of one it takes 5 of the other" in said
    for tests in (3, 6):  # three pairs one way, and both ways
        assert needed(1, 1, tests=tests, level=LEVEL) == (5, 4)
        assert tests * least_p(5, 5) < LEVEL, "the third renderer meets two of which one has 5"
        assert tests * least_p(4, 4) >= LEVEL
    assert "Three renderers take 5, 5 and 4 runs, one way or both" in said


def test_rounding_is_told_as_such(tmp_path):
    one = recording(1)
    runs = [
        Run(
            f"{name}{k}",
            name,
            Recording(one.time + k, {**one.channels, "force": one.force * (1.0 + 1e-15 * (k + more))}),
        )
        for name, more in (("a", 0), ("b", 4))
        for k in range(4)
    ]
    alike = align(runs, Abscissa("angle"))
    text = table(alike, compare(alike))
    assert "a and b, forward, size of the force: the same to rounding" in text
    assert "differs" not in text


def test_a_single_repeat_is_drawn_and_refused(tmp_path, capsys):
    given = files(tmp_path, *"aaab")
    assert main(["compare", *given, "-o", str(tmp_path / "out")]) == 2
    told = capsys.readouterr()
    assert "'b' has a single repeat" in told.err
    assert (tmp_path / "out" / "comparison.svg").exists()


def test_a_run_without_a_renderer_must_be_named(tmp_path, capsys):
    path = tmp_path / "plain.h5"
    write_recording(path, recording(1))
    assert main(["compare", str(path), "-o", str(tmp_path)]) == 2
    assert f"constraint={path}" in capsys.readouterr().err
    assert main(["compare", f"mine={path}", "-o", str(tmp_path / "out")]) == 0
    assert "| mine |" in capsys.readouterr().out


def test_angles_are_shown_in_degrees(aligned, tmp_path):
    found = table(aligned, compare(aligned))
    most = [line.split("most at ")[1].split()[0] for line in found.splitlines() if "most at" in line]
    assert all(math.degrees(0.2) - 1.0 <= float(each) <= math.degrees(2.2) + 1.0 for each in most)
