"""`hapticeval figure` from outside: the files, what is refused, and the same from Python."""

import re

import pytest

from hapticeval import api
from hapticeval.cli import main
from hapticeval.errors import InputError, UnknownNameError

pytestmark = pytest.mark.usefixtures("in_process")

TWO = ["-r", "local_mine:Good", "-r", "local_mine:Jumps"]


@pytest.mark.system
def test_a_figure_of_two_renderers_in_every_format_and_of_an_earlier_run(here, capsys):
    for name in ("fig.pdf", "fig.svg", "fig.png"):
        options = ["--check", "continuous-contact", "-o", name]
        assert main(["figure", "slides.toml/flat", *TWO, *options]) == 0
        assert capsys.readouterr().out == f"wrote {name}\n"
    content = (here / "fig.pdf").read_bytes()
    assert re.search(rb"/MediaBox \[ 0 0 249\.4", content), "88 mm"
    assert b"/Type3" not in content
    svg = (here / "fig.svg").read_text()
    assert all(
        text in svg for text in ("IHIP, local_mine:Good (pass)", "IHIP, local_mine:Jumps (fail)", "y₁ (mm)", "time (s)")
    )
    assert (here / "fig.png").read_bytes().startswith(b"\x89PNG")
    assert not (here / "results").exists()
    main(["run", "slides.toml", "--no-report", *TWO])
    named = ["--label", "local_mine:Good=nearest point"]
    assert main(["figure", "slides.toml/flat", "--from", "results", *named, "-o", "again.svg"]) == 0
    again = (here / "again.svg").read_text()
    assert ">IHIP, nearest point<" in again
    assert ">IHIP, local_mine:Jumps<" in again
    assert main(["figure", "flat", "--from", "results", "--width", "3.5in"]) == 0
    assert b"/MediaBox [ 0 0 252 " in (here / "figure-flat.pdf").read_bytes()


@pytest.mark.parametrize(
    ("arguments", "code", "what"),
    [
        (["slides.toml/flat", *TWO, "--width", "88"], 2, "it has no unit"),
        (["slides.toml/flat", *TWO, "--height", "3ft"], 2, "'ft' is not a known unit"),
        (["slides.toml/flat", *TWO, "--width", "3mm"], 2, "30 to 1200 mm"),
        (["slides.toml/flat", *TWO, "-o", "fig.jpg"], 2, ".pdf, .svg, .png"),
        (["slides.toml/flat", *TWO, "--label", "nearest"], 2, "it is not NAME=TEXT"),
        (["slides.toml/flat", *TWO, "--label", "local_mine:Goood=a"], 2, "did you mean local_mine:Good"),
        (["slides.toml/flta", *TWO], 2, "did you mean flat"),
        (["slides.toml/flat", *TWO, "--check", "continuous"], 2, "continuous-contact"),
        (["slides.toml/flat", "-r", "local_mine:Breaks"], 3, "the sensor is gone"),
        (["star-convex-corner", "-r", "set-stabilisation"], 2, "recorded nothing"),
        (["flat", "--from", "absent"], 2, "absent"),
    ],
)
def test_what_cannot_be_drawn_says_why_and_writes_nothing(here, capsys, arguments, code, what):
    assert main(["figure", *arguments]) == code
    assert what in capsys.readouterr().err
    assert not list(here.glob("*.pdf"))


def test_several_cases_are_run_and_drawn_together(here, capsys):
    cases = ["slides.toml/flat", "slides.toml/flat-back", "-r", "local_mine:Good"]
    assert main(["figure", *cases, "-o", "figures"]) == 0
    assert capsys.readouterr().out == "wrote figures/figure-flat.pdf\nwrote figures/figure-flat-back.pdf\n"
    assert main(["figure", *cases, "-o", "one.pdf"]) == 2
    assert "2 figures do not fit into one file" in capsys.readouterr().err


def test_the_grid_of_a_run_and_what_is_no_document(here, capsys):
    main(["run", "slides.toml", "--no-report", *TWO])
    assert main(["figure", "results/results.json", "-o", "grid.pdf", "-r", "local_mine:Jumps"]) == 0
    assert b"/Type3" not in (here / "grid.pdf").read_bytes()
    assert main(["figure", "results/results.json", "-r", "local_mine:Absent"]) == 2
    assert "renderer of these results" in capsys.readouterr().err
    assert main(["figure", "flat", "--from", "results", "-r", "local_mine:Absent"]) == 2
    assert "judge all of them in one run (-r A -r B)" in capsys.readouterr().err
    for name, content in (("other.json", "[]"), ("limits-x.json", '{"workspace": null}'), ("cut.json", '{"a"')):
        (here / name).write_text(content)
        assert main(["figure", name]) == 2
        assert name in capsys.readouterr().err
    assert [path.name for path in here.glob("*.pdf")] == ["grid.pdf"]


@pytest.mark.system
def test_a_table_for_a_paper_has_the_renderers_in_their_order(here, capsys):
    main(["run", "slides.toml", "--no-report", *TWO])
    assert main(["table", "results", "-r", "local_mine:Jumps", "-r", "local_mine:Good", "--width", "88mm"]) == 0
    text = (here / "phenomena.tex").read_text()
    assert re.search(r"phenomenon & local\\_mine:Jumps & local\\_mine:Good", text)
    assert "\\toprule" in text
    assert main(["table", "results", "phenomena", "--row", "Continuous*", "-o", "one.tex"]) == 0
    assert (here / "one.tex").read_text().count(r"\\") == 2, "head and one row"
    main(["run", "thesis", "-k", "star-convex-corner", "--no-report", "-o", "stars", *TWO])
    assert main(["table", "stars", "summary"]) == 0, "one suite: its summary needs no suite's name"
    assert "Resists" in (here / "summary.tex").read_text()
    for arguments, code, what in (
        (["-r", "local_mine:Absent"], 2, "local_mine:Jumps"),
        (["phenomenon"], 2, "did you mean phenomena"),
        (["--row", "Nothing*"], 4, "no row of 'phenomena' matches"),
    ):
        assert main(["table", "results", *arguments]) == code
        assert what in capsys.readouterr().err


def test_the_same_from_python(refused, here):
    results = api.run(["local_mine:Good", "local_mine:Jumps"], suites="slides.toml", workers=0)
    fig = results.plot("flat", renderers=["local_mine:Jumps"], check="continuous-contact", width="120mm", font_size=7)
    assert fig.get_figwidth() == pytest.approx(120 / 25.4)
    names = [text.get_text() for text in results.plot("flat", width="88mm").legends[0].get_texts()]
    assert names == ["HIP", "IHIP, local_mine:Good", "IHIP, local_mine:Jumps"]
    fig = results.plot("flat", labels={"local_mine:Good": "right"}, check="continuous-contact")
    assert [text.get_text() for text in fig.legends[0].get_texts()][1] == "IHIP, right (pass)"
    ticks = results.plot_grid(labels={"local_mine:Jumps": "wrong"}).axes[0].get_yticklabels()
    assert [tick.get_text() for tick in ticks] == ["local_mine:Good", "wrong"]
    with refused(InputError):
        results.plot(width="88mm")
    with pytest.raises(UnknownNameError):
        results.plot("flat", check="continuous")
