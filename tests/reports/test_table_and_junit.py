"""The tables as data and as markdown, JUnit XML, and a scene in words."""

from __future__ import annotations

import math
import re
import xml.etree.ElementTree as ET

import pandas as pd
import pytest
from reports_synthetic import HOSTILE, synthetic_results, synthetic_run, verdict
from result_entries import SCENE, changed

from hapticeval.devices.inner_loop import InnerLoop
from hapticeval.effects.actuators import Delay, JointFriction, Saturation
from hapticeval.effects.sensors import Encoder, ForceSensor, VelocityFilter
from hapticeval.effects.viscous_friction import Viscosity
from hapticeval.errors import RefusalError
from hapticeval.files import csv_cell
from hapticeval.phenomena.verdict import Finding, Metric, Outcome
from hapticeval.reports import ReportView, junit, markdown, render_pages, summaries
from hapticeval.reports.exports import (
    LINE_CHARACTERS,
    SMALLEST_LETTERS,
    latex_of_table,
    parts_that_fit,
    write_tables,
)
from hapticeval.reports.table import LIMIT
from hapticeval.reports.templates import figures_cited, robot_words, scene_words
from hapticeval.runner.results import Ended, Problem, Robot
from hapticeval.table import Cell, Table


def test_the_summary_puts_the_published_values_beside(results):
    (table,) = summaries(results)
    assert table.renderers == ("plain", HOSTILE)
    rows = {row.title: row.cells for row in table.rows}
    assert rows["Resists <Pop>"] == (("No", "No"), ("Yes", "No"))
    assert rows["Suitable for LUT"] == (("Yes", None), (None, None))


def test_all_formats_of_a_table_have_the_same_cells():
    table = Table("t", ["case", "a | b"], [["x", Cell("pass", "good", "✓")], ["y", Cell("=1", "bad")]])
    assert table.markdown.splitlines()[2:] == ["| x    | ✓ pass |", "| y    | **=1** |"]
    assert table.csv == "case,a | b\nx,pass\ny,'=1\n"
    assert table.columns == [("case", "x", "y"), ("a | b", "pass", "=1")]
    assert table.turned.texts == [["a | b", "pass", "=1"]]
    assert table.turned.turned.texts == table.texts


def test_no_cell_of_a_table_is_a_formula_or_steers_a_terminal(results, tmp_path):
    """A spreadsheet computes what begins with =, +, - or @, as a title or a message of anyone may."""
    first, *others = results.verdicts
    hurt = changed(first, message="=1+1", case="@SUM(A1)\x1b[2J")
    write_tables(tmp_path, changed(results, verdicts=[hurt, *others]))
    tables = {file.name: pd.read_csv(file, dtype=str, keep_default_na=False) for file in tmp_path.rglob("*.csv")}
    assert "'=1+1" in tables["verdicts.csv"]["message"].tolist()
    for table in tables.values():
        cells = [*table.columns, *table.to_numpy().ravel()]
        assert not any(re.match(r"[=@]|[+-](?![\d.]|-*$)", cell) for cell in cells)
        assert not any("\x1b" in cell for cell in cells)
    assert csv_cell("-0.5e-3") == "-0.5e-3"
    assert csv_cell("--") == "--"
    assert csv_cell("-1+cmd|' /C calc'!A0") == "'-1+cmd|' /C calc'!A0"
    assert "\x1b" not in markdown(changed(results, verdicts=[hurt, *others]))


def test_markdown_begins_with_the_summary_and_cannot_be_broken_out_of(results):
    text = markdown(results)
    for expected in (
        "# hapticeval: 4 of 13 verdicts are not as expected, broken and plain broke in 2 runs, which lost 1 verdict",
        "13 of 13 planned verdicts ran: 1 in error, 2 failed, 2 differ from what is published, 2 warn",
        "hapticeval 0.1.0; seed 3.",
        "**Yes (published: No)**",
        "- ≠ plain on synthetic/lobe/contact-normal-force: pass, published fail; angle = 0.25 deg, bound 1 deg",
        "- broken on synthetic/lobe: 1 verdict lost; it raised",
    ):
        assert expected in text
    order = [
        "## Renderers by phenomena",
        "## Summary",
        "## What broke",
        "## Not as expected",
        "## Warnings",
        "## Every case",
    ]
    assert sorted(order, key=text.index) == order
    assert "<script>" not in text
    assert len({len(line) for line in text.splitlines() if line.startswith("|")}) == 3
    assert "| a \\| b \\| c " in markdown(synthetic_results(table={"a | b\n| c": {"plain": "Yes"}}))
    interrupted = synthetic_results(planned=40, complete=False, reason="interrupted by the user")
    assert "13 of 40 planned verdicts ran: incomplete, interrupted by the user" in markdown(interrupted)
    assert "|" not in markdown(synthetic_results(runs=[], verdicts=[], table={}, published_table={}))


def test_markdown_gives_the_reason_of_what_is_known_and_of_what_is_refused(results):
    failing = results.verdicts[4]
    known = [changed(failing, case=f"case-{number}", known="a | limit", as_expected=True) for number in range(7)]
    refused = changed(results.runs[0], case="far", refusal=Problem.of(RefusalError("a model in space")))
    text = markdown(synthetic_results(verdicts=known, runs=[*results.runs, refused]))
    assert (
        f"## Known\n\n- {failing.renderer}: a \\| limit: {known[0].place}, {known[1].place}, {known[2].place}, "
        f"{known[3].place}, {known[4].place}, and 2 others\n"
    ) in text
    assert f"## Refused\n\n- {refused.renderer}: a model in space: {refused.suite}/far\n" in text
    assert "## Refused" not in markdown(results)


@pytest.mark.parametrize("count", [1, 100, 2000])
def test_markdown_fits_into_a_comment_and_says_what_it_leaves_out(results, count):
    cases = [f"a-case-of-a-long-name-{number}" for number in range(count)]
    verdicts = [changed(results.verdicts[4], case=case, suite=f"suite-{case}") for case in cases]
    runs = [changed(results.runs[0], case=case, suite=f"suite-{case}") for case in cases]
    text = markdown(synthetic_results(verdicts=verdicts, runs=runs))
    assert len(text.encode()) <= LIMIT
    assert ("left out here" in text) is (count == 2000)
    assert text.startswith(f"# hapticeval: {count:,} of {count:,} verdict")


def test_a_measure_reads_well():
    jump = Finding(Outcome.FAIL, "jumps", Metric("jump", 0.004, "m"), 1e-4)
    assert verdict("c", "r", "x", jump).measured == "jump = 4 mm, bound 0.1 mm"
    assert verdict("c", "r", "x", Finding(Outcome.PASS, "fine")).measured == ""


# JUnit.


def parsed(results):
    return ET.fromstring(junit(results))


def cases(root, renderer="plain", case="lobe"):
    return {
        each.get("name").partition(" [")[0]: each
        for each in root.iter("testcase")
        if each.get("classname") == f"synthetic.{case}" and each.get("name").endswith(f"[{renderer}]")
    }


def kinds(case):
    return [child.tag for child in case]


def test_a_failure_is_exactly_what_is_not_as_expected(results):
    root = parsed(results)
    assert [suite.get("name") for suite in root] == [f"synthetic: {name}" for name in results.renderers]
    found = cases(root)
    assert {name: kinds(case) for name, case in found.items()} == {
        "continuous-contact": ["system-out"],
        "contact-normal-force": ["failure"],
        "centripetal-force": ["skipped"],
        "memoryless": ["system-out"],
        "broken-contact": ["failure"],
        "impulsive-collision": ["skipped"],
    }
    assert found["continuous-contact"][0].text.startswith(
        "fails, and is known: a limit of the method: pop-through <here>"
    )
    assert found["broken-contact"][0].get("message") == "pop-through <here> (IHIP jump = 40 mm, bound 1 mm)"
    assert found["contact-normal-force"][0].get("message").startswith("pass, published fail: ")
    warned = "warning: inconclusive: too slow | to say"
    assert found["centripetal-force"][0].get("message") == warned
    strict = cases(parsed(synthetic_results(strict=True)))
    assert kinds(strict["centripetal-force"]) == ["failure"]
    assert kinds(strict["impulsive-collision"]) == ["skipped"]


def test_an_inconclusive_verdict_that_is_published_as_pass_is_no_skip(results):
    verdicts = list(results.verdicts)
    verdicts[2] = changed(verdicts[2], published=Outcome.PASS, as_expected=False)
    assert kinds(cases(parsed(synthetic_results(verdicts=verdicts)))["centripetal-force"]) == ["failure"]


def test_errors_are_errors_with_and_without_a_verdict(results):
    root = parsed(results)
    assert kinds(cases(root, "broken")["continuous-contact"]) == ["error"]
    lost = cases(root, "plain", "tip")["run"]
    assert kinds(lost) == ["error"]
    assert lost[0].get("message") == "it raised <ValueError> at tick 7"
    assert "mend it" in lost[0].text
    assert "\x1b" not in junit(results)
    assert HOSTILE in root[2].get("name")


def test_the_counts_add_up_and_names_are_unique(results):
    root = parsed(results)
    for name, tag in (("tests", "testcase"), ("failures", "failure"), ("errors", "error"), ("skipped", "skipped")):
        assert int(root.get(name)) == len(list(root.iter(tag))) == sum(int(suite.get(name)) for suite in root)
    unexpected = [each for each in results.verdicts if not each.as_expected and each.outcome != "error"]
    assert int(root.get("failures")) == len(unexpected)
    names = {(case.get("classname"), case.get("name")) for case in root.iter("testcase")}
    assert len(names) == int(root.get("tests")) == len(results.verdicts) + 1


def test_a_suite_carries_date_version_and_the_commit_of_its_renderer():
    date = "2026-11-22T10:47:21+00:00"
    for suite in parsed(synthetic_results(date=date, commits={"plain": "0123abcd-dirty"})):
        found = {each.get("name"): each.get("value") for each in suite.iter("property")}
        commit = {"commit": "0123abcd-dirty"} if suite.get("name") == "synthetic: plain" else {}
        assert found == {"hapticeval": "0.1.0", "suite": "synthetic", **commit}
        assert suite.get("timestamp") == date
    assert not any(suite.get("timestamp") for suite in parsed(synthetic_results()))


def test_an_incomplete_run_is_in_error(results):
    root = parsed(synthetic_results(planned=40, complete=False, reason="interrupted by the user"))
    (case,) = [case for case in root.iter("testcase") if case.get("name") == "every planned verdict ran"]
    assert kinds(case) == ["error"]
    assert case[0].get("message") == "13 of 40 planned verdicts ran: incomplete, interrupted by the user"
    assert not [case for case in parsed(results).iter("testcase") if case.get("classname") == "hapticeval"]


# A scene in words: every number with its unit, and nothing of what the scene does not call for.

ROBOT = {
    "device": Robot(kind="parallelogram-3dof", dynamics="lagrangian", base_inertia="sin"),
    "inner_loop": InnerLoop.LINEARISED,
}


def run(**scene):
    return synthetic_run("lobe", "plain", "cassinian", scene=changed(SCENE, **scene))


def test_gains_have_their_units_and_what_is_zero_is_not_told():
    assert scene_words(run()) == "stiffness 1000 N/m, mass 0.1 kg, 1000 Hz, unilateral"
    assert "viscosity 0.3 kg/s" in scene_words(run(effects=[Viscosity(0.3).document()]))


def test_a_robot_says_which_dynamics_and_which_inertia_it_has_a_choice_of():
    assert robot_words(run()) == "", "playback has none"
    assert robot_words(run(**ROBOT)) == (
        "parallelogram-3dof, Lagrangian dynamics, d₀ with sin² x₃, inner loop by feedback linearisation (6.7); "
        "no imperfections"
    )
    printed = Robot(kind="parallelogram-3dof", dynamics="printed", base_inertia="cos")
    assert "dynamics as printed (2.26), d₀ with cos² x₃" in robot_words(run(**{**ROBOT, "device": printed}))
    flat = robot_words(run(**{**ROBOT, "device": changed(printed, kind="parallelogram-2dof")}))
    assert "dynamics" not in flat
    assert "d₀" not in flat
    own = Robot(kind="parallelogram-2dof", constants={"l4": 0.4, "b1": 0.0})
    assert robot_words(run(**{**ROBOT, "device": own})).startswith("parallelogram-2dof, l4 = 400 mm, b1 = 0 N m s/rad,")


@pytest.mark.parametrize(
    ("effect", "words"),
    [
        (Encoder(2.0 * math.pi / 262144), "encoders of 2.397e-5 rad a count (262,144 counts a turn)"),
        (VelocityFilter(50.0), "velocity from differences, low-passed at 50 Hz"),
        (Delay(0.0005), "torques 0.5 ms late"),
        (Saturation(0.368), "motors saturate at 0.368 N m"),
        (JointFriction(0.02), "Coulomb friction of 0.02 N m in each joint"),
        (ForceSensor(step=0.01), "force sensor (quantum 0.01 N)"),
        (ForceSensor(), "force sensor, ideal"),
    ],
)
def test_each_effect_of_the_robot_in_words(effect, words):
    assert robot_words(run(**{**ROBOT, "effects": [effect.document()]})).endswith(f"; {words}")


def test_a_point_mass_has_metres_and_newtons_for_joints():
    mass = {"device": Robot(kind="point-mass"), "inner_loop": InnerLoop.STATIC}
    words = robot_words(run(**mass, effects=[Encoder(1e-5).document(), Saturation(2.0).document()]))
    assert words == "point-mass; encoders of 0.01 mm a count, motors saturate at 2 N"


@pytest.mark.parametrize(
    ("citation", "figures"),
    [
        ("6.3.3, Table 6.2, Figure 6.22; 7.3.2, (7.38), Figure 7.3", "Figures 6.22 and 7.3"),
        ("7.4.2, Figures 7.6 to 7.8", "Figures 7.6 to 7.8"),
        ("6.3.2, Table 6.1, Figure 6.19; 7.3.1, (7.28)", "Figure 6.19"),
        ("6.3.2, (6.17), Table 6.1", ""),
        (None, ""),
    ],
)
def test_figures_by_their_numbers(citation, figures):
    assert figures_cited(synthetic_run("lobe", "plain", "cassinian", citation=citation)) == figures


def test_a_run_that_ended_early_is_told_in_every_report(results):
    ended = Ended(tick=123, time=0.123, what="the arm left its <workspace>", why="x2 = 1.2 rad")
    runs = [changed(results.runs[0], ended=ended), *results.runs[1:]]
    sentence = "ended early at t = 0.123 s, tick 123: the arm left its <workspace> (x2 = 1.2 rad)"
    assert [run.ended_words for run in runs[:2]] == [sentence, ""]
    told = synthetic_results(runs=runs)
    assert "1 run ended early" in render_pages(ReportView(told))["index.html"]
    assert f"- plain on synthetic/lobe {sentence.replace('<', '&lt;')}" in markdown(told)
    given = parsed(told).find(".//testcase[@name='contact-normal-force [plain]']")
    assert sentence in given.find("failure").get("message")


@pytest.mark.parametrize("count", [2, 9])
def test_a_wide_table_is_set_small_in_columns_that_share_the_page(count):
    sheet = Table("t", [f"one+{k}" for k in range(count)], [["-0.25", *["known, 10 of 83"] * (count - 1)]], "Title")
    text = latex_of_table(sheet, 1.0)
    assert "$-$0.25" in text
    assert "one+\\allowbreak{}1" in text
    widths = [float(each) for each in re.findall(r"p{([\d.]+)\\linewidth}", text)]
    assert len(widths) == (9 if count == 9 else 0)
    assert sum(widths) < 0.95
    assert (r"{\scriptsize" in text or r"{\footnotesize" in text) == (count == 9)


def test_a_share_and_a_count_are_broken_over_no_line():
    cells = ["pass, 1 of 12, 100 % left", "-0.5", "of 2 % or 3 of them"]
    sheet = Table("t", ["", "a", "b"], [cells], "Title")
    text = latex_of_table(sheet, 1.0)
    assert "pass, 1~of~12, 100\\,\\%~left & $-$0.5 & of 2\\,\\% or 3 of them" in text
    assert text.startswith("\\begin{table}[tbp]\n\\centering\n\\setlength{\\belowcaptionskip}{6pt}\n\\caption{Title}\n")
    narrow = latex_of_table(sheet, 0.1)
    widths = [float(width) for width in re.findall(r"p{([\d.]+)\\linewidth}", narrow)]
    assert widths[0] == pytest.approx(10 * widths[1] / len("-0.5"), rel=0.05), "as wide as 100 % left"


def test_a_table_of_many_rows_has_its_head_on_each_page():
    text = latex_of_table(Table("t", ["a", "b"], [["x", "1"]] * 41, "Title"), 1.0)
    assert text.startswith(
        "\\begin{longtable}{ll}\n\\caption{Title} \\label{tab:t} \\\\\n\\toprule\na & b \\\\\n\\midrule\n\\endfirsthead"
    )
    assert text.count("a & b \\\\") == 2
    assert text.count("x & 1 \\\\") == 41
    assert text.endswith("\\end{longtable}\n")


@pytest.mark.parametrize("line", [0.5, 1.0])
def test_a_table_that_is_too_wide_is_cut_into_parts_that_fit(line):
    """Each column of words of 20 characters; 88 fit into a line of the smallest letters."""
    sheet = Table("t", ["x", *(f"renderer{k:012d}" for k in range(9))], [["a", *["pass"] * 9]], "Title")
    parts = list(parts_that_fit(sheet, line))
    assert [name for part in parts for name in part.header[1:]] == sheet.header[1:]
    assert {part.header[0] for part in parts} == {"x"}
    assert [part.caption for part in parts] == [f"Title ({k + 1} of {len(parts)})" for k in range(len(parts))]
    for part in parts:
        assert sum(map(len, part.header)) <= line * LINE_CHARACTERS[SMALLEST_LETTERS]
    assert len(parts) == (3 if line == 1.0 else 9)
