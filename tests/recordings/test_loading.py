"""Files of every kind at the command line: journals, damaged recordings, and what is never written over."""

import numpy as np
import pytest
from recording_files import flipped, journal_of

from hapticeval.cli import main
from hapticeval.recordings import hdf5
from hapticeval.recordings.hdf5 import LOST_EVENT, read_recording, write_recording
from hapticeval.recordings.importing.convert import is_ours, load
from hapticeval.recordings.journal import MAGIC
from hapticeval.recordings.provenance import describe_losses
from hapticeval.recordings.recording import Clock, Recording

ROWS = 400
META = {"renderer": "minimum-distance", "scene": {"stiffness": 1000.0, "model": {"kind": "circle", "size": 0.2}}}


def run(rows=ROWS):
    """A hand that slides under a circle of 0.1 m: its HIPs and IHIPs, and the force of a spring between them."""
    turn = 1e-3 * np.arange(rows)
    normal = np.column_stack([np.cos(turn), np.sin(turn)])
    hip = (0.098 + 0.001 * np.sin(9.0 * turn))[:, None] * normal
    channels = {"hip": hip, "ihip": 0.1 * normal, "force": 1000.0 * (0.1 * normal - hip)}
    return Recording.clocked(Clock(1_000_000 * np.arange(rows)), channels, META)


def test_a_journal_becomes_a_recording_and_reports_what_is_lost(unpictured, here, capsys):
    data = b"".join(journal_of(run(), size=50, closed=False))
    (here / "run.journal").write_bytes(data[: int(0.6 * len(data))])
    assert main(["convert", "run.journal", "-o", "run.h5"]) == 1
    assert "breaks off inside a block; what came from cycle 200 on is unknown" in capsys.readouterr().out
    made = read_recording(here / "run.h5")
    assert made.force.tobytes() == run().force[:200].tobytes()
    assert [event.kind for event in made.events] == [LOST_EVENT]
    for file in ("run.journal", "run.h5"):  # what was lost is not forgotten by converting it
        assert main(["inspect", file]) == 1
        assert "suspicious: lost (all): the end, bytes" in capsys.readouterr().out


def test_one_wrong_byte_hides_no_journal(here):
    data = b"".join(journal_of(run(), size=50))
    for place in range(len(MAGIC)):
        (here / "hurt.journal").write_bytes(flipped(data, place, bit=4))
        assert is_ours(here / "hurt.journal")
    assert len(load(here / "hurt.journal")) == ROWS


def test_a_recording_that_is_cut_is_examined_and_salvaged_when_asked_to(unpictured, here, capsys, monkeypatch):
    monkeypatch.setattr(hdf5, "ROWS_A_CHUNK", 50)
    write_recording(here / "run.h5", run())
    data = (here / "run.h5").read_bytes()
    (here / "run.h5").write_bytes(data[: int(0.7 * len(data))])
    assert main(["convert", "run.h5", "-o", "whole.h5"]) == 2
    assert "hapticeval convert run.h5 --salvage -o run-whole.h5" in capsys.readouterr().err
    assert main(["replay", "run.h5", "-r", "minimum-distance"]) == 2  # judged only where someone said so
    assert main(["convert", "run.h5", "--salvage", "-o", "whole.h5"]) == 1
    made = read_recording(here / "whole.h5")
    sound = made.sound_rows()[0]
    assert sound.stop >= 150
    assert made.hip[sound].tobytes() == run().hip[sound].tobytes()
    lost = ROWS - len(made)
    assert (
        f"every signal, rows {len(made)} to {ROWS - 1}: {lost} rows ({1e-3 * lost:.3g} s)" in describe_losses(made)[1]
    )
    capsys.readouterr()
    assert main(["inspect", "run.h5"]) == 1
    assert "suspicious: lost (all): the file ends at byte" in capsys.readouterr().out
    (here / "run.h5").write_bytes(data[: int(0.02 * len(data))])  # nothing of it is whole
    assert main(["inspect", "run.h5"]) == 2
    assert "salvage" not in capsys.readouterr().err


def test_a_run_whose_loop_died_reports_so(unpictured, here, capsys):
    (here / "run.journal").write_bytes(b"".join(journal_of(run(), size=50, closed="the loop died")))
    assert main(["convert", "run.journal", "-o", "run.h5"]) == 1
    assert "ended: the loop died" in capsys.readouterr().out
    assert main(["inspect", "run.h5"]) == 0
    assert "note: ended (all): the loop died" in capsys.readouterr().out
    (here / "m.toml").write_text("")
    assert main(["inspect", "run.journal", "--mapping", "m.toml"]) == 2
    assert "it needs no mapping" in capsys.readouterr().err


@pytest.mark.parametrize("suffix", ["h5", "mat", "csv", "npz"])
def test_nothing_is_written_over(here, capsys, suffix):
    write_recording(here / "run.h5", run())
    theirs = here / f"theirs.{suffix}"
    theirs.write_bytes(b"theirs")
    assert main(["convert", "run.h5", "-o", theirs.name]) == 2
    assert "is there already" in capsys.readouterr().err
    assert theirs.read_bytes() == b"theirs"


@pytest.mark.usefixtures("in_process")
def test_a_replay_never_removes_the_recording_that_it_replays(undrawn, here):
    write_recording(here / "run.h5", run())
    assert main(["replay", "run.h5", "-r", "minimum-distance", "-o", "results"]) in (0, 1)
    (kept,) = (here / "results").rglob("minimum-distance.h5")
    before = kept.read_bytes()
    assert main(["replay", str(kept.relative_to(here)), "-r", "minimum-distance", "-o", "results"]) == 2
    assert kept.read_bytes() == before
