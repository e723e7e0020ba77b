"""What `make mutants` changes, and that a mutant takes the place of its module."""

import subprocess
import sys

import mutate

SOURCE = """
def least(values, n: int = 3):
    if n <= 2 and not values:
        return -1.5 * n
    return f"{min(values) + 1:.3g}"
"""


def test_each_operator_comparison_and_number_is_changed_and_nothing_else(tmp_path, monkeypatch):
    monkeypatch.setattr(mutate, "ROOT", tmp_path)
    file = tmp_path / "module.py"
    file.write_text(SOURCE)
    mutants = [mutate.mutant_of(file, number) for number in range(mutate.count_in(file))]
    assert {(mutant.line, mutant.after) for mutant in mutants} >= {
        (3, "n < 2"),
        (3, "n >= 2"),
        (3, "n <= 3"),
        (3, "n <= 2 or not values"),
        (2, "4"),
        (2, "6"),
        (3, "not not values"),
        (4, "-1.5 / n"),
        (4, "-2.5"),
        (4, "--1.5"),
        (5, "f'{max(values) + 1:.3g}'"),
        (5, "f'{min(values) - 1:.3g}'"),
        (5, "f'{min(values) + 2:.3g}'"),
    }
    assert not any(".4g" in mutant.source for mutant in mutants), "a format decides nothing"
    for mutant in mutants:
        compile(mutant.source, "mutant", "exec")
        assert mutant.before != mutant.after


def test_a_guard_is_not_changed(tmp_path):
    file = tmp_path / "module.py"
    file.write_text("pairs = zip(a, b, strict=True)\n")
    assert mutate.count_in(file) == 0


def test_equality_is_asked_of_counts_alone(tmp_path):
    file = tmp_path / "module.py"
    for source, count in (
        ("near = distance <= bound", 1),
        ("near = distance <= scene.model.size", 1),
        ("n <= a.size", 2),
    ):
        file.write_text(source)
        assert mutate.count_in(file) == count


def test_a_line_belongs_to_the_outermost_function_around_it():
    source = "x = 1\nclass A:\n    y = 2\n    def f(self):\n        def g():\n            return 3\n        return g\n"
    assert mutate.functions_by_line(source) == dict.fromkeys((4, 5, 6, 7), "A.f")


def test_a_number_on_import_is_tried_on_tests_that_run_nothing_of_the_targets(tmp_path):
    reach = mutate.Reach([])
    reach.seconds = {"reads": 1.0, "uses": 1.0, "other": 1.0}
    reach.lines[mutate.Line("a.py", "f", "return LIMIT")] = {"uses"}
    reach.lines[mutate.Line("a.py", "g", "return 1")] = {"other"}
    assert reach.tests_of(mutate.Mutant("b.py", 1, "LIMIT = 1", "LIMIT = 2", "", None)) == {"reads", "uses"}


def test_what_reached_a_line_that_was_written_anew_since_is_tried_on_its_function(tmp_path, monkeypatch):
    monkeypatch.setattr(mutate, "ROOT", tmp_path)
    (tmp_path / "a.py").write_text("def f(x):\n    y = 2 * x\n    return y\n")
    reach = mutate.Reach([str(tmp_path / "a.py")])
    for function, text, test in (
        ("f", "y = 2 * x", "new"),
        ("f", "z = 2 * x", "before"),
        ("f", "return y", "returns"),
        ("g", "z = 1", "of another"),
    ):
        reach.lines[mutate.Line("a.py", function, text)] = {test}
    assert reach.tests_of(mutate.Mutant("a.py", 2, "2", "3", "", "f")) == {"new", "before"}


def test_a_mutant_is_imported_in_place_of_its_module():
    file = mutate.ROOT / "hapticeval" / "quantity.py"
    code = "import sys; sys.path.insert(0, 'tests'); import mutate; sys.meta_path.insert(0, mutate.Finder("
    code += f"mutate.Mutant('hapticeval/quantity.py', 1, '', '', {'number = None'!r}, None))); "
    code += "import hapticeval.quantity; print(hapticeval.quantity.number, hapticeval.quantity.__file__)"
    done = subprocess.run([sys.executable, "-c", code], cwd=mutate.ROOT, capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["None", str(file)]


def test_what_alone_kills_a_mutant_is_told_of_tests_that_may_go(tmp_path, monkeypatch):
    monkeypatch.setattr(mutate, "ROOT", tmp_path)
    file = tmp_path / "a.py"
    file.write_text("def f(x):\n    return 2 * x\n\n\ndef g(x):\n    return 3 * x\n")
    reach = mutate.Reach([str(file)])
    reach.seconds = dict.fromkeys(("go.py::kills", "go.py::passes", "stay.py::passes"), 1.0)
    reach.lines[mutate.Line("a.py", "f", "return 2 * x")] = set(reach.seconds)
    reach.lines[mutate.Line("a.py", "g", "return 3 * x")] = {"stay.py::passes"}
    drawn = mutate.reached_places([file], reach, ["go.py"])
    assert {mutate.mutant_of(*place).function for place in drawn} == {"f"}

    def run(tests, mutant, reached):
        return mutate.KILLED if mutant and "go.py::kills" in tests else 0

    mutant = mutate.mutant_of(*drawn[0])
    court = mutate.Court(reach, run, ("go.py",))
    assert court.survives(mutant)
    assert court.killers(mutant) == ["go.py::kills"]
    assert not mutate.Court(reach, run, ()).survives(mutant)
