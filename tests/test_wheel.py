"""The wheel installs without a network and judges outside of the checkout, in a folder with spaces."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


def typed(*words, cwd, **environment):
    """What a command prints; it must end with 0."""
    done = subprocess.run(
        [*map(str, words)], cwd=cwd, env={**os.environ, **environment}, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.mark.system
def test_the_wheel_installs_offline_and_judges_in_a_folder_with_spaces(tmp_path):
    folder = tmp_path / "a folder with spaces"
    folder.mkdir()
    # Building fetches setuptools, as `make lint` does; installing asks no network.
    build = ("wheel", "--no-deps", "--wheel-dir", folder / "wheels", ROOT)
    typed(sys.executable, "-m", "pip", *build, cwd=folder)
    (wheel,) = (folder / "wheels").glob("hapticeval-*.whl")
    target = folder / "installed here"
    typed(sys.executable, "-m", "pip", "install", "--no-deps", "--no-index", "--target", target, wheel, cwd=folder)
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    (folder / "mine.py").write_text(re.findall(r"```python\n(.*?)```", text, re.DOTALL)[0])
    command = (sys.executable, "-m", "hapticeval")
    # The libraries are those of this environment, the package is the wheel's.
    place = typed(
        sys.executable, "-c", "import hapticeval; print(hapticeval.__file__)", cwd=folder, PYTHONPATH=str(target)
    )
    assert str(target) in place
    typed(*command, "run", "-r", "mine:Nearest", "-k", "plane-press", cwd=folder, PYTHONPATH=str(target))
    assert (folder / "results" / "report" / "index.html").exists()
    assert (target / "hapticeval" / "examples" / "notebooks" / "judge_a_renderer.ipynb").exists()


@pytest.mark.system
def test_a_checkout_that_is_not_installed_says_so():
    # Without site-packages there are neither libraries nor the package's metadata.
    done = subprocess.run(
        [sys.executable, "-S", "-m", "hapticeval"], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 2
    assert done.stderr.startswith("error: hapticeval is not installed")
    assert "make run" in done.stderr
    assert "Traceback" not in done.stderr
