"""Each kernel is compiled once: by one of the processes that want it, and for one type of array."""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np
import pytest

from hapticeval import kernel_cache
from hapticeval.compiled import compiled, for_kernels
from hapticeval.records import as_record, numbers_of, record_type, room_for

KERNEL = """
from hapticeval.compiled import compiled

@compiled
def kernel(values):
    total = 0.0
    for value in values:
        total += value
    return total
"""

WATCHED = """
import numpy as np
from hapticeval import pulse
from kernel import kernel

class Seen(list):
    def __setitem__(self, place, value):
        super().__setitem__(place, value)
        print(*self)

pulse.share_pulse(Seen([0, 0]), [0.0] * 5)
print(kernel(np.arange(4.0)), kernel(np.arange(4.0)))
"""

ASK = """
import sys
import numpy as np
from kernel import kernel

print("ready", flush=True)
sys.stdin.readline()
print(kernel(np.arange(4.0)), sum(kernel.stats.cache_misses.values()), sum(kernel.stats.cache_hits.values()))
"""

LOCKED = """
import sys
import numpy as np
from numba.core.dispatcher import Dispatcher
from numba.core.types import Array
from hapticeval.discovery import resolve
from hapticeval.geometry.catalogue import make_model
from hapticeval.scene import Scene

points = np.array([[0.01, 0.02], [0.3, -0.1]])
points.flags.writeable = False
for kind in ("cassinian", "star"):
    model = make_model(kind, size=0.2)
    model.curve.closest_point(points)
    model.polygon().signed_distance(points)
    for name in ("minimum-distance", "constraint"):
        renderer = resolve(name)(Scene(model=model))
        renderer.reset(points[0])
        renderer.step(points[0], np.zeros(2), 1e-3)
        if renderer.law is not None:
            law, scratch = renderer.law, [np.zeros(2) for _ in range(4)]
            law.function(law.data, points[0].copy(), *scratch[:2], 1e-3, *scratch[2:])
kernels = {
    kernel
    for name, module in list(sys.modules.items()) if name.startswith("hapticeval.")
    for kernel in vars(module).values() if isinstance(kernel, Dispatcher)
}
signatures = [(kernel.__name__, each) for kernel in kernels for each in kernel.signatures + kernel.called.signatures]
print(len(signatures))
odd = lambda kind: isinstance(kind, Array) and not (kind.mutable and kind.layout == "C")
print([(name, kinds) for name, kinds in signatures if any(map(odd, kinds))])
"""


def with_kernel(folder):
    """Write KERNEL into a folder, and return the environment in which it is imported and its code is kept there."""
    (folder / "kernel.py").write_text(KERNEL)
    path = os.pathsep.join([str(folder), os.environ.get("PYTHONPATH", "")])
    return {**os.environ, "PYTHONPATH": path, "NUMBA_CACHE_DIR": str(folder / "cache")}


@pytest.mark.system
def test_of_processes_that_want_a_kernel_at_once_one_compiles_it(tmp_path):
    pytest.importorskip("fcntl")
    environment = with_kernel(tmp_path)
    processes = [
        subprocess.Popen(
            [sys.executable, "-c", ASK], env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        for _ in range(3)
    ]
    assert [process.stdout.readline() for process in processes] == ["ready\n"] * 3
    for process in processes:
        process.stdin.write("go\n")
        process.stdin.flush()
    answers = sorted(process.communicate()[0].split() for process in processes)
    assert answers == [["6.0", "0", "1"], ["6.0", "0", "1"], ["6.0", "1", "0"]]


CALLING = """
from hapticeval.compiled import compiled
from called import doubled
from constants import SHIFT

@compiled
def kernel(value):
    return doubled(value) + SHIFT

print(kernel(4.0), len(kernel.stats.cache_hits))
"""

CALLED = """
from hapticeval.compiled import compiled

@compiled
def doubled(value):
    return 2.0 * value
"""


@pytest.mark.system
def test_a_kernel_is_compiled_anew_when_what_it_calls_or_a_number_in_it_changes(tmp_path):
    environment = with_kernel(tmp_path)
    files = {"calling": CALLING, "called": CALLED, "constants": "SHIFT = 1.0"}

    def answer(**changed):
        for name, text in {**files, **changed}.items():
            if not (file := tmp_path / f"{name}.py").exists() or file.read_text() != text:
                file.write_text(text)
        command = [sys.executable, "-B", "-c", "import calling"]
        return subprocess.run(command, env=environment, capture_output=True, text=True, check=True).stdout.split()

    assert answer() == ["9.0", "0"]
    assert answer() == ["9.0", "1"]
    assert answer(called=CALLED.replace("2.0", "3.0")) == ["13.0", "0"]
    assert answer(constants="SHIFT = 2.5") == ["10.5", "0"]
    assert answer() == ["9.0", "1"]


def test_folders_that_nobody_uses_any_more_are_removed(tmp_path, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    digests = iter(["first", "second", "third"])
    monkeypatch.setattr(kernel_cache, "digest_of", lambda module: next(digests))
    for remaining in (["m-first"], ["m-first", "m-second"]):
        kernel_cache.folder_of("m").mkdir(parents=True)
        assert sorted(folder.name for folder in kernel_cache.kernel_folder().iterdir()) == remaining
    os.utime(kernel_cache.kernel_folder() / "m-first", (0, 0))
    kernel_cache.folder_of("m").mkdir()
    assert sorted(folder.name for folder in kernel_cache.kernel_folder().iterdir()) == ["m-second", "m-third"]


@pytest.mark.system
def test_who_waits_is_told_while_a_kernel_is_compiled(tmp_path):
    environment = with_kernel(tmp_path)
    ended = subprocess.run([sys.executable, "-c", WATCHED], env=environment, capture_output=True, text=True, check=True)
    assert ended.stdout.splitlines() == ["0 1", "0 0", "6.0 6.0"]


@pytest.mark.parametrize("values", [np.arange(6.0).reshape(2, 3)[:, 1:], np.broadcast_to(1.0, 3)])
def test_kernels_are_given_arrays_of_one_type(values):
    given = for_kernels(values)
    assert given.flags.writeable
    assert given.flags.c_contiguous
    np.testing.assert_array_equal(given, values)


def test_what_is_fit_for_kernels_is_not_copied():
    values = np.zeros((2, 3))
    assert for_kernels(values) is values


@pytest.mark.system
def test_no_kernel_is_compiled_for_locked_arrays():
    """Curves and polygons lock their arrays, and points may come from a recording, which does too."""
    ended = subprocess.run([sys.executable, "-c", LOCKED], capture_output=True, text=True, check=True)
    compiled, locked = ended.stdout.splitlines()
    assert int(compiled) > 8
    assert locked == "[]"


TOOL = record_type("touches", "piece", base=record_type("in_contact", normal=3), place=2)


@compiled
def _write_tool(numbers, rows):
    tool, second = as_record(numbers, TOOL, 1), as_record(rows, TOOL, 1)
    tool.touches, tool.normal[2], tool.place[0] = 3.0, 4.0, tool.piece + 5.0
    second.in_contact, second.place[1] = 6.0, tool.place[0]


@pytest.mark.parametrize("write", [_write_tool, getattr(_write_tool, "py_func", _write_tool)])
def test_a_record_names_numbers_where_they_are_in_kernels_as_in_python(write):
    numbers = np.append(-1.0, numbers_of(TOOL, in_contact=0.0, normal=(1.0, 2.0), touches=0.0, piece=2.0, place=0.0))
    rows = np.zeros((2, room_for(TOOL) + 3))
    write(numbers, rows)
    assert numbers.tolist() == [-1.0, 0.0, 1.0, 2.0, 4.0, 3.0, 2.0, 7.0, 0.0]
    assert rows[0].tolist() == [0.0] * 11
    assert rows[1].tolist() == [6.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 7.0, 0.0, 0.0, 0.0]


@compiled
def _halve(size, exact):
    return size // 2 if exact else 0.5 * size


@compiled
def _halve_constants(size):
    return _halve(size, True) + _halve(size, False) + _halve(7, True)


@compiled
def _quarter(size):
    return 0.25 * size


@compiled
def _sum_of_quarters(size):
    return _quarter(size) + _quarter(2.0 * size)


def test_what_only_kernels_call_is_compiled_without_ways_in_from_python():
    assert _sum_of_quarters(4.0) == 3.0
    assert not _quarter.signatures
    # and Python can still call it: that is code of its own
    assert _quarter(8.0) == 2.0
    assert len(_quarter.signatures) == 1


def test_a_constant_argument_compiles_no_kernel_of_its_own():
    assert _halve(3, True) == 1
    assert _halve_constants(5) == 7.5
    # and what Python has called already is what other kernels call
    assert len(_halve.signatures) == 1
    assert not _halve.called.signatures


def test_arrays_are_made_once_and_anew_where_their_file_is_damaged_or_nothing_is_shared(tmp_path, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    made = []

    def make():
        made.append(len(made))
        return {"values": np.array([0.1, float(len(made))]), "size": np.array(0.25)}

    def ask(name=b"one"):
        arrays = kernel_cache.shared_arrays(__name__, name, make)
        return arrays["values"].tolist(), float(arrays["size"])

    assert [ask(), ask()] == [([0.1, 1.0], 0.25)] * 2
    assert ask(b"another") == ([0.1, 2.0], 0.25)
    with kernel_cache.sharing_nothing():
        assert ask() == ([0.1, 3.0], 0.25)
    assert ask() == ([0.1, 1.0], 0.25)
    for file in tmp_path.rglob("*.npz"):
        file.write_bytes(file.read_bytes()[:100])
    assert [ask(), ask()] == [([0.1, 4.0], 0.25)] * 2
