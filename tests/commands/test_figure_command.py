"""`hapticeval figure` from outside: the files, what is refused, and the same from Python."""

import re

import pytest

from hapticeval import api
from hapticeval.cli import main
from hapticeval.errors import InputError, UnknownNameError

pytestmark = pytest.mark.usefixtures("in_process")

TWO = ["-r", "local_mine:Good", "-r", "local_mine:Jumps"]


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
    assert main(["figure", "slides.toml/flat", "--from", "results", "-o", "again.svg"]) == 0
    assert main(["figure", "flat", "--from", "results", "--width", "3.5in"]) == 0
    assert b"/MediaBox [ 0 0 252 " in (here / "figure-flat.pdf").read_bytes()


@pytest.mark.parametrize(
    ("arguments", "code", "what"),
    [
        (["slides.toml/flat", *TWO, "--width", "88"], 2, "it has no unit"),
        (["slides.toml/flat", *TWO, "--height", "3ft"], 2, "'ft' is no such unit"),
        (["slides.toml/flat", *TWO, "--width", "3mm"], 2, "30 to 1200 mm"),
        (["slides.toml/flat", *TWO, "-o", "fig.jpg"], 2, ".pdf, .svg, .png"),
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


def test_the_same_from_python(here):
    results = api.run(["local_mine:Good", "local_mine:Jumps"], suites="slides.toml", workers=0)
    fig = results.plot("flat", renderers=["local_mine:Jumps"], check="continuous-contact", width="120mm", font_size=7)
    assert fig.get_figwidth() == pytest.approx(120 / 25.4)
    fig.savefig(here / "fig.pdf")
    assert b"/Type3" not in (here / "fig.pdf").read_bytes()
    names = [text.get_text() for text in results.plot("flat", width="88mm").legends[0].get_texts()]
    assert names == ["HIP", "IHIP, local_mine:Good", "IHIP, local_mine:Jumps"]
    with pytest.raises(InputError, match="6 runs with a recording"):
        results.plot(width="88mm")
    with pytest.raises(UnknownNameError):
        results.plot("flat", check="continuous")
