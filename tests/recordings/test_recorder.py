"""The live recorder against what ends recordings: a slow writer, a dead one, a killed loop, a full disk."""

import gc
import os
import resource
import signal
import subprocess
import sys
import time
import tracemalloc
from collections import Counter
from types import SimpleNamespace

import numpy as np
import pytest

from hapticeval.errors import HapticevalError, InputError
from hapticeval.recordings.channels import Signal
from hapticeval.recordings.journal import BLOCK_HEAD, Kind, blocks, recover
from hapticeval.recordings.provenance import describe_losses
from hapticeval.recordings.recorder import Counters, LossWarning, Recorder, Writer

CHANNELS = {"hip": 2, "force": 2}
GRIP = {"grip": Signal("N", "grip force", "device")}


def feed(recorder, count, first=0):
    for k in range(first, first + count):
        recorder.append((k, -k), (0.5 * k, 1.0))


def assert_fed(recording):
    """The rows are those that `feed` gave, each at its number."""
    k = recording.clock.sequence.astype(float)
    np.testing.assert_array_equal(recording.hip, np.column_stack([k, -k]))
    np.testing.assert_array_equal(recording.force, np.column_stack([0.5 * k, np.ones_like(k)]))


def until(condition):
    deadline = time.monotonic() + 60.0
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.02)


def stop(recorder):
    """Stop the writer, and wait until it stands."""
    os.kill(recorder.writer, signal.SIGSTOP)
    os.waitid(os.P_PID, recorder.writer, os.WSTOPPED | os.WNOWAIT)


def rows_of(path):
    """How many rows the journal has by now."""
    try:
        return len(recover(path))
    except InputError:
        return 0


def test_what_is_appended_is_recorded(tmp_path):
    path = tmp_path / "deep" / "run.journal"
    stamps = [7, 1_000_007, 2_500_000]
    rng = np.random.default_rng(3)
    hips, joints, grips = rng.normal(size=(3, 1)), rng.normal(size=(3, 4)), rng.normal(size=3)
    channels = {"hip": 1, "joint_position": 4, "grip": 0}
    with Recorder(path, channels, signals=GRIP, meta={"who": "A. Tester"}) as recorder:
        recorder.event("start", "touches the wall", at=1_000_000)
        for row, stamp in enumerate(stamps):
            recorder.append(hips[row], list(joints[row]), grips[row], at=stamp)
    summary = recorder.close()
    assert (summary.rows, summary.lost, summary.failure) == (3, 0, "")
    recording = recover(path)
    assert recording.nanoseconds.tolist() == stamps
    assert recording.time.tolist() == [0.0, 0.001, 0.002499993]
    for name, values in (("hip", hips), ("joint_position", joints), ("grip", grips)):
        assert recording.channels[name].tobytes() == values.tobytes()
    assert recording.signals["grip"] == GRIP["grip"]
    assert [event[1:] for event in recording.events] == [("start", "touches the wall")]
    assert recording.meta["who"] == "A. Tester"
    assert abs(recording.clock.anchor[1] - time.time_ns()) < 3600 * 10**9


def test_the_head_of_a_block_counts_its_rows_and_no_other_block_has_any(tmp_path):
    path = tmp_path / "run.journal"
    with Recorder(path, {"hip": 1, "grip": 0}, signals=GRIP) as recorder:
        recorder.event("start", "touches the wall", at=0)
        for row in range(5):
            recorder.append([0.0], 0.0, at=row)
    counts = Counter()
    for block in blocks(data := path.read_bytes()):
        _, kind, _, rows, size, _ = BLOCK_HEAD.unpack_from(data, block.at)
        assert rows == (size // 32 if kind == Kind.ROWS else 0), "32 bytes of sequence, stamp and two numbers"
        counts[Kind(kind)] += rows or 1
    assert counts == {Kind.HEADER: 2, Kind.EVENT: 1, Kind.ROWS: 5, Kind.END: 1}


def test_rows_beyond_the_ring_arrive_in_order_where_the_writer_keeps_up(tmp_path):
    with Recorder(tmp_path / "run.journal", CHANNELS, rows=64) as recorder:
        for first in range(0, 300, 50):
            feed(recorder, 50, first)
            until(lambda: recorder.summary.waiting == 0)
    recording = recover(tmp_path / "run.journal")
    assert recording.clock.sequence.tolist() == list(range(300))
    assert_fed(recording)


def test_a_stopped_writer_never_stops_the_loop_and_every_row_lost_is_counted(tmp_path):
    path = tmp_path / "run.journal"
    recorder = Recorder(path, CHANNELS, rows=100)
    feed(recorder, 20)
    until(lambda: recorder.summary.waiting == 0)
    stop(recorder)
    feed(recorder, 250, 20)
    summary = recorder.summary
    assert (summary.rows, summary.waiting, summary.overrun) == (20, 100, 150)
    os.kill(recorder.writer, signal.SIGCONT)
    until(lambda: recorder.summary.waiting == 0)
    recorder.missed(4)
    feed(recorder, 5, 274)
    with pytest.warns(LossWarning, match=r"run\.journal: 125 rows recorded, 150 lost, 4 cycles missed"):
        recorder.close()
    recording = recover(path)
    assert recording.clock.sequence.tolist() == [*range(120), *range(274, 279)]
    assert recording.clock.missed == 154
    assert_fed(recording)
    (event,) = [event for event in recording.events if event.kind == "overrun"]
    assert event.text == "150 rows were lost: the writer was too late"


def test_a_loop_without_a_clock_waits_for_room(tmp_path):
    """Memory for 64 rows, and 300 of them as fast as they come: none is lost where the loop waits."""
    with Recorder(tmp_path / "run.journal", CHANNELS, rows=64) as recorder:
        for k in range(300):
            recorder.wait_for_room()
            feed(recorder, 1, first=k)
        summary = recorder.close()
    assert (summary.rows, summary.lost) == (300, 0)


@pytest.mark.filterwarnings("ignore::hapticeval.recordings.recorder.LossWarning")
def test_a_loop_without_a_clock_does_not_wait_for_a_dead_writer(tmp_path):
    with Recorder(tmp_path / "run.journal", CHANNELS, rows=64) as recorder:
        os.kill(recorder.writer, signal.SIGKILL)
        os.waitid(os.P_PID, recorder.writer, os.WEXITED | os.WNOWAIT)
        for k in range(200):
            recorder.wait_for_room()
            feed(recorder, 1, first=k)
    assert recorder.failed


def test_a_writer_that_dies_is_reported_once_and_its_work_done_at_the_end(tmp_path):
    recorder = Recorder(tmp_path / "run.journal", CHANNELS, rows=2000)
    feed(recorder, 30)
    os.kill(recorder.writer, signal.SIGKILL)
    until(lambda: recorder.summary.failure)
    assert recorder.failed == ""
    with pytest.warns(LossWarning, match=r"run.journal: the writer's process ended with code -9; \d+ more rows fit"):
        feed(recorder, 300, 30)
    assert recorder.failed == recorder.summary.failure == "the writer's process ended with code -9"
    feed(recorder, 600, 330)  # and once
    with pytest.warns(LossWarning, match=r"930 rows recorded, 0 lost \(the writer's process ended"):
        recorder.close()
    recording = recover(tmp_path / "run.journal")
    assert recording.clock.sequence.tolist() == list(range(930))
    assert_fed(recording)
    assert recording.events[-1].text == "the writer's process ended with code -9"


LOOP = """
import sys, time
from pathlib import Path
from hapticeval.recordings.recorder import Recorder
recorder = Recorder(Path(sys.argv[1]), {"hip": 2, "force": 2})
print(recorder.writer, flush=True)
begin = time.monotonic()
k = 0
while True:
    recorder.append((k, -k), (0.5 * k, 1.0))
    k += 1
    if k % 100 == 0:
        print(k, flush=True)
    time.sleep(max(0.0, begin + 0.001 * k - time.monotonic()))
"""


@pytest.mark.parametrize("writer_too", [False, True])
def test_a_killed_loop_loses_only_what_was_not_yet_written(tmp_path, writer_too):
    """The writer keeps up while the loop goes on. How far behind it is depends on the machine, so no clock is asked."""
    path = tmp_path / "run.journal"
    loop = subprocess.Popen([sys.executable, "-c", LOOP, str(path)], stdout=subprocess.PIPE, text=True)
    writer = int(loop.stdout.readline())
    for _ in range(8):
        count = int(loop.stdout.readline())
        until(lambda rows=count: rows_of(path) >= rows)
    before = rows_of(path)
    if writer_too:  # first, for it would write the end when the loop is gone
        os.kill(writer, signal.SIGKILL)
    loop.kill()
    loop.wait()
    loop.stdout.close()
    if not writer_too:
        until(lambda: not describe_losses(recover(path)))
    recording = recover(path)
    assert_fed(recording)
    assert recording.clock.missed == 0
    if writer_too:
        assert len(recording) >= before
        (*_, loss) = describe_losses(recording)
        assert "was not closed" in loss or "breaks off" in loss
    else:
        assert len(recording) >= count
        (_, kind, text) = recording.events[-1]
        last = int(recording.clock.sequence[-1])
        unknown = f"what came after cycle {last} is unknown"
        assert (kind, text) == ("ended", f"the process of the loop ended without closing: {unknown}")


def test_a_full_disk_does_not_stop_the_loop_and_what_was_lost_is_named(tmp_path):
    path = tmp_path / "run.journal"
    recorder = Recorder(path, CHANNELS, rows=200)
    resource.prlimit(recorder.writer, resource.RLIMIT_FSIZE, (16_000, 16_000))
    feed(recorder, 150)
    until(lambda: recorder.summary.waiting == 0)
    sent = 150
    while not recorder.summary.failure:
        feed(recorder, 50, sent)
        sent += 50
        until(lambda: recorder.summary.waiting == 0 or recorder.summary.failure)
    feed(recorder, 250, sent)
    sent += 250
    assert recorder.summary.overrun > 0
    with pytest.warns(LossWarning, match="lost"):
        summary = recorder.close()
    assert summary.rows + summary.lost == sent
    assert summary.waiting == 200
    assert summary.failure == "the journal could not be written: File too large"
    recording = recover(path)
    assert recording.clock.sequence.tolist() == list(range(summary.rows))
    assert_fed(recording)
    # the end is short, and finds room where no block of rows does
    assert describe_losses(recording)[-1].startswith("the end, rows that the recorder could not write: 200 rows (")
    texts = [event.text for event in recording.events if event.kind == "overrun"]
    assert texts[-1].endswith("rows were lost: the journal could not be written: File too large")


def test_a_disk_that_is_full_for_a_while_loses_nothing(tmp_path):
    path = tmp_path / "run.journal"
    with Recorder(path, CHANNELS, rows=2000) as recorder:
        writer = recorder.writer
        resource.prlimit(writer, resource.RLIMIT_FSIZE, (8_000, resource.RLIM_INFINITY))
        feed(recorder, 1000)
        until(lambda: recorder.summary.failure)
        assert recorder.summary.waiting > 500
        resource.prlimit(writer, resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
    assert (recorder.summary.lost, recorder.summary.failure) == (0, "")
    recording = recover(path)
    assert describe_losses(recording) == ()
    assert recording.clock.sequence.tolist() == list(range(1000))
    assert_fed(recording)


def test_appending_takes_no_memory_beyond_what_was_there_at_the_start(tmp_path):
    hip, force = np.zeros(2), np.ones(2)
    with Recorder(tmp_path / "run.journal", CHANNELS, rows=40_000) as recorder:
        recorder.append(hip, force)
        tracemalloc.start()
        recorder.append(hip, force)
        before = tracemalloc.get_traced_memory()[0]
        tracemalloc.reset_peak()
        for _ in range(20_000):
            recorder.append(hip, force)
        gc.collect()
        after, peak = tracemalloc.get_traced_memory()
        tracemalloc.stop()
    # a row is 48 bytes: keeping each would take 960 kB; a call's own few numbers come and go
    assert after - before < 2_000
    assert peak - before < 4_000


MISFITS = [
    ((0.0, 0.0),),
    ((0.0, 0.0), (0.0, 0.0, 0.0)),
    ((0.0,), (0.0, 0.0)),
    (np.zeros((1, 2)), np.zeros(2)),
    (np.zeros((2, 1)), np.zeros(2)),
    (1.0, (0.0, 0.0)),
    (("x", "y"), (0.0, 0.0)),
    (None, (0.0, 0.0)),
]


@pytest.mark.parametrize("free", [20, 1])
def test_values_that_do_not_fit_are_refused_and_reach_no_other_row(refused, tmp_path, free):
    """Also where the ring ends behind the row."""
    recorder = Recorder(tmp_path / "run.journal", CHANNELS, rows=len(MISFITS) + free)
    stop(recorder)
    for row, values in enumerate(MISFITS):
        with refused(InputError):
            recorder.append(*values)
        feed(recorder, 1, row)
    with refused(InputError):
        recorder.append((0.0, 0.0), (0.0, 0.0), at=1.5)
    with refused(InputError):
        recorder.append((9.0, -9.0), [7.0] * 500)
    feed(recorder, 1, len(MISFITS))
    recorder.missed(4)
    for impossible in (-1, 2**64 - 191):
        with pytest.raises(InputError, match="cannot have been missed"):
            recorder.missed(impossible)
    os.kill(recorder.writer, signal.SIGCONT)
    summary = recorder.close()
    assert (summary.rows, summary.missed) == (len(MISFITS) + 1, 4)
    with refused(InputError):
        feed(recorder, 1)
    recording = recover(tmp_path / "run.journal")
    assert recording.clock.sequence.tolist() == list(range(len(MISFITS) + 1))
    assert_fed(recording)


def test_a_recorder_that_cannot_start_leaves_no_file(refused, tmp_path, monkeypatch):
    (tmp_path / "file").write_bytes(b"precious")
    with refused(HapticevalError):
        Recorder(tmp_path / "file" / "deep" / "run.journal", CHANNELS)
    with refused(InputError):
        Recorder(tmp_path / "file", CHANNELS)
    monkeypatch.setattr(sys, "executable", "false")
    with refused(HapticevalError):
        Recorder(tmp_path / "run.journal", CHANNELS)
    assert [each.read_bytes() for each in tmp_path.iterdir()] == [b"precious"]


def test_a_recorder_on_a_full_disk_says_what_to_do(tmp_path, monkeypatch):
    monkeypatch.setattr("os.write", lambda *_: 0)
    with pytest.raises(HapticevalError, match="cannot write") as caught:
        Recorder(tmp_path / "run.journal", CHANNELS)
    assert (caught.value.why, caught.value.todo) == (
        "No space left on device", "name another place, or mend what bars this one",
    )  # fmt: skip


def test_a_loop_that_breaks_leaves_its_reason(tmp_path):
    def loop():
        with Recorder(tmp_path / "run.journal", CHANNELS) as recorder:
            feed(recorder, 2)
            raise RuntimeError("the motor is hot")

    with pytest.raises(RuntimeError, match="hot"):
        loop()
    (event,) = recover(tmp_path / "run.journal").events
    assert event[1:] == ("ended", "RuntimeError: the motor is hot")


def test_events_are_cut_where_a_letter_ends_and_counted_when_there_are_too_many(refused, tmp_path):
    recorder = Recorder(tmp_path / "run.journal", CHANNELS)
    feed(recorder, 1)
    recorder.event("long", "ö" * 200)
    with refused(InputError):
        recorder.event("")
    for k in range(5000):
        recorder.event("many", str(k))
    with pytest.warns(LossWarning, match="events lost"):
        recorder.close()
    events = recover(tmp_path / "run.journal").events
    assert events[0].text == "ö" * 108
    kept = [event for event in events if event.kind == "many"]
    assert len(kept) + recorder.summary.events_lost == 5000
    assert f"{recorder.summary.events_lost} events were lost" in " ".join(event.text for event in events)


def test_a_script_needs_no_guard_and_ctrl_c_ends_with_everything_written(tmp_path):
    script = tmp_path / "json.py"  # a name that must not be found before the real one
    script.write_text(
        "import sys; sys.path.pop(0)\n"
        "import time\n"
        "from pathlib import Path\n"
        "from hapticeval.recordings.recorder import Recorder\n"
        "with Recorder(Path(sys.argv[1]), {'hip': 2, 'force': 2}) as recorder:\n"
        "    for k in range(50): recorder.append((k, -k), (0.5 * k, 1.0))\n"
        "    print(flush=True)\n"
        "    time.sleep(60)\n"
    )
    path = tmp_path / "run.journal"
    loop = subprocess.Popen(
        [sys.executable, str(script), str(path)],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
        cwd=tmp_path,
    )
    loop.stdout.readline()
    os.killpg(loop.pid, signal.SIGINT)
    loop.wait()
    loop.stdout.close()
    recording = recover(path)
    assert describe_losses(recording) == ()
    assert_fed(recording)
    assert recording.events[-1].kind == "ended"


@pytest.mark.parametrize(
    ("losses", "reported", "told"),
    [
        ((0, 0), (0, 0), []),
        ((3, 0), (0, 0), ["3 rows"]),
        ((3, 2), (3, 0), ["2 events"]),
        ((7, 2), (3, 2), ["4 rows"]),
        ((7, 5), (3, 2), ["4 rows", "3 events"]),
    ],
)
def test_what_was_lost_since_the_last_look_is_told_once(losses, reported, told):
    overrun, event_overrun = losses
    counters = Counters(overrun=overrun, event_overrun=event_overrun)
    writer, texts = Writer(SimpleNamespace(counters=counters), -1), []
    writer.reported = reported
    writer._event = lambda stamp, kind, text: texts.append(text) or True
    writer._report_overrun()
    assert texts == [f"{what} were lost: the writer was too late" for what in told]
    writer._report_overrun()
    assert len(texts) == len(told)
