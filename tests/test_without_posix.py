"""Without what only POSIX systems have: the package imports, runs, and draws its report, in one process."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

STUB = Path(__file__).parent / "without_posix"
MINE = """
from hapticeval import Response
class Mine:
    def __init__(self, scene):
        self.boundary, self.stiffness = scene.model.boundary, scene.stiffness
    def reset(self, hip):
        pass
    def step(self, hip, velocity, dt):
        at = self.boundary.closest_point([hip])
        ihip = at.foot[0] if at.distance[0] < 0 else hip
        return Response(ihip, self.stiffness * (ihip - hip))
"""


def python(folder, *arguments):
    """Run Python where POSIX is lacking, in a folder."""
    environment = {**os.environ, "PYTHONPATH": str(STUB), "PYTHONDONTWRITEBYTECODE": "1"}
    return subprocess.run([sys.executable, *arguments], cwd=folder, env=environment, capture_output=True, text=True)


TRIED = """
for what in ("import fcntl", "import resource", "import os; os.fork()", "import signal; signal.SIGALRM",
             "import os; os.open('.', os.O_RDONLY)"):
    try:
        exec(what)
    except Exception:
        continue
    print(what)
"""


def test_the_stub_takes_away_what_windows_lacks(tmp_path):
    done = python(tmp_path, "-c", TRIED)
    assert (done.returncode, done.stdout) == (0, ""), done.stderr


@pytest.mark.system
def test_a_run_judges_and_reports(tmp_path):
    (tmp_path / "mine.py").write_text(MINE)
    done = python(tmp_path, "-m", "hapticeval", "run", "-r", "mine:Mine", "-k", "plane-press")
    assert done.returncode == 0, done.stdout + done.stderr
    assert (tmp_path / "results" / "report" / "index.html").exists()
    done = python(tmp_path, "-m", "hapticeval", "run", "-r", "mine:Mine", "-k", "star-convex-corner")
    assert done.returncode == 1, done.stdout + done.stderr


WATCHED = """
import sys
import hapticeval.api, hapticeval.renderers, hapticeval.reports.write
from hapticeval.cli import main
sys.exit(main(["run", "-r", "mine:Mine", "-k", "plane-press", "--watch"]))
"""


def test_every_module_that_a_run_needs_imports_and_what_needs_posix_says_so(tmp_path):
    (tmp_path / "mine.py").write_text(MINE)
    done = python(tmp_path, "-c", WATCHED)
    assert done.returncode == 2, done.stderr
    assert "--watch runs on Linux and macOS alone" in done.stderr
