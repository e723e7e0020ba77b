"""`hapticeval reproduce`: what the thesis shows, computed, drawn and compared."""

import re

import pytest

from hapticeval.cli import main
from hapticeval.study.thesis.printed import read_items


def test_the_list_has_every_item(capsys):
    assert main(["reproduce", "--list"]) == 0
    text = " ".join(capsys.readouterr().out.split())
    assert all(name in text for name in read_items())


def test_a_figure_is_drawn_and_compared(tmp_path, capsys):
    assert main(["reproduce", "figure-6.22", "table-a.1", "-o", str(tmp_path)]) == 0
    text = " ".join(capsys.readouterr().out.split())
    # (6.26): the orbit at K_p r^3 (r - r_c) = L^2, of 43.947 mm in continuous time, and what a tick of 1 ms adds.
    assert re.search(r"distance at the end: 4[45]\.\d+ mm \(asked > 0 mm\)", text)
    assert "l4: 0.346 (in print 0.346)" in text
    # An error of the print differs, and the reason is said.
    assert "! PP+PD is asymptotically stable" in text
    page = (tmp_path / "index.html").read_text(encoding="utf-8")
    assert re.findall(r'<article class="item" id="([\w.-]+)"', page) == ["figure-6.22", "table-a.1"]
    pictures = re.findall(r'src="([^"]+)"', page)
    assert len(pictures) == 2
    assert all((tmp_path / name).read_text(encoding="utf-8").startswith("<?xml") for name in pictures)


@pytest.mark.system
def test_the_table_comes_out_as_published(tmp_path):
    assert main(["reproduce", "table-6.3", "-o", str(tmp_path)]) == 0
    page = (tmp_path / "index.html").read_text(encoding="utf-8")
    rows = [re.findall(r"<t[dh][^>]*>([^<]*)</t", row) for row in re.findall(r"<tr>(.*?)</tr>", page, re.DOTALL)]
    assert rows[0] == ["", "minimum-distance", "constraint", "mapping"]
    ours, printed = rows[1::2], rows[2::2]
    assert ours[0] == ["Resists Pop-Through on Curves", "No", "No", "Yes"]
    assert len(ours) == 4
    assert [row[1:] for row in ours] == [row[1:] for row in printed]


def test_a_difference_without_a_reason_is_no_success(tmp_path, monkeypatch, capsys):
    import msgspec

    from hapticeval.commands import reproduce
    from hapticeval.study.thesis import printed

    item = printed.read_items()["Table A.1"]
    wrong = msgspec.structs.replace(item, claims=(msgspec.structs.replace(item.claims[0], value="0.301"),))
    for module in (printed, reproduce):
        monkeypatch.setattr(module, "read_items", lambda: {"Table A.1": wrong})
    assert main(["reproduce", "table-a.1", "-o", str(tmp_path)]) == 1
    assert "l1: 0.3 (in print 0.301; differs by -0.001; no reason is known)" in capsys.readouterr().out
    assert "1 for none" in (tmp_path / "index.html").read_text(encoding="utf-8").replace("\n", " ")


def test_what_the_thesis_has_not_is_refused(capsys):
    assert main(["reproduce", "figure-6.220"]) == 2
    assert "did you mean figure-6.22" in capsys.readouterr().err


def test_a_folder_that_cannot_be_is_refused_before_anything_runs(tmp_path, capsys):
    (tmp_path / "file").touch()
    assert main(["reproduce", "all", "-o", str(tmp_path / "file")]) == 2
    assert "cannot write" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("word", "said"),
    [
        ("6.22", ["Figure 6.22", "dynamics-circle/circle", "hapticeval reproduce figure-6.22"]),
        ("table-6.3", ["Table 6.3", "hapticeval reproduce table-6.3", "centripetal-force"]),
        ("(4.12)", ["Table 4.1", "PP+D", "hapticeval reproduce table-4.1"]),
        ("figure-6.3", ["Figures 6.2 and 6.3", "hapticeval reproduce figure-6.2"]),
        ("figure-2.5", ["not computed photographs"]),
    ],
)
def test_a_number_of_the_thesis_is_explained_by_what_shows_it(word, said, capsys):
    assert main(["explain", word]) == 0
    text = " ".join(capsys.readouterr().out.split())
    assert [words for words in said if words not in text] == []


@pytest.mark.system
def test_all_of_it_comes_out_or_is_explained(tmp_path):
    assert main(["reproduce", "all", "-o", str(tmp_path)]) == 0
    page = (tmp_path / "index.html").read_text(encoding="utf-8")
    assert page.count('<article class="item"') == len(read_items())
    # A reason that explains nothing any more is out of date.
    claims = {claim.says: claim for item in read_items().values() for claim in item.claims if claim.why}
    agreeing = re.findall(r'<td class="agrees">✓</td><td>(.*?)(?: <small>|</td>)', page)
    assert set(agreeing) & set(claims) == set()
