"""A dask scheduler and its workers as processes of this machine, for tests: started, killed, and ended."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any, Self

DASK = [sys.executable, "-m", "dask"]


class Cluster:
    """A scheduler and some workers in `folder`, from which workers import; a context manager."""

    def __init__(self, folder: Path, workers: int) -> None:
        self.folder = folder
        self.workers = workers
        self.log = (folder / "cluster.log").open("a")
        self.processes: list[subprocess.Popen[Any]] = []

    def __enter__(self) -> Self:
        self.start_scheduler()
        for _ in range(self.workers):
            self.start_worker()
        return self

    def __exit__(self, *_: object) -> None:
        for process in self.processes:
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()
        self.log.close()

    def start_scheduler(self) -> None:
        """Start one; its address is `address` then."""
        file = self.folder / "scheduler.json"
        file.unlink(missing_ok=True)
        self.scheduler = self._start(
            ["scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--scheduler-file", str(file)]
        )
        while True:
            assert self.scheduler.poll() is None
            try:
                self.address = json.loads(file.read_text())["address"]
            except (OSError, ValueError):
                time.sleep(0.05)
            else:
                return

    def start_worker(self, *options: str, **environment: str) -> subprocess.Popen[Any]:
        """Start a worker of one thread, with a nanny that starts another where it is killed."""
        arguments = ["worker", self.address, "--nthreads", "1", "--no-dashboard", "--local-directory", str(self.folder)]
        return self._start([*arguments, *options], **environment)

    def pids(self) -> list[int]:
        """The workers themselves, without their nannies; waits until as many as were started are there."""
        from distributed import Client

        with Client(self.address, set_as_default=False) as client:
            client.wait_for_workers(self.workers, timeout=60)
            return list(client.run(os.getpid).values())

    def _start(self, arguments: list[str], **environment: str) -> subprocess.Popen[Any]:
        path = os.pathsep.join(filter(None, [environment.pop("PYTHONPATH", ""), str(self.folder)]))
        process = subprocess.Popen(
            [*DASK, *arguments],
            cwd=self.folder,
            env={**os.environ, "PYTHONPATH": path, **environment},
            stdout=self.log,
            stderr=self.log,
            start_new_session=True,
        )
        self.processes.append(process)
        return process
