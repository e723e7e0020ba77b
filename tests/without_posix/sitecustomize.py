"""Takes away from this interpreter what Python lacks on Windows: a stand-in, for the tests that put it on the path."""

# Loaded before, so that the standard library keeps what it took on its own account.
import multiprocessing.context  # noqa: F401
import os
import shutil
import signal
import subprocess  # noqa: F401
import sys
import tempfile  # noqa: F401

for module in ("fcntl", "resource", "termios", "pty", "tty", "pwd", "grp", "syslog"):
    sys.modules[module] = None

for name in ("SIGALRM", "SIGKILL", "SIGUSR1", "SIGUSR2", "SIGHUP", "SIGSTOP", "SIGCONT", "setitimer", "ITIMER_REAL",
             "pthread_kill", "alarm"):  # fmt: skip
    if hasattr(signal, name):
        delattr(signal, name)

_open = os.open


def _open_no_folder(path, flags, *rest, **more):
    if os.path.isdir(path):  # noqa: PTH112 - as the original takes it
        raise PermissionError(13, "Permission denied", path)
    return _open(path, flags, *rest, **more)


os.open = _open_no_folder
shutil._use_fd_functions = False

# The ids of users stay: libraries ask for them where sys.platform says that this is no Windows.
for name in ("fork", "forkpty", "killpg", "sched_getaffinity", "register_at_fork", "memfd_create", "pwrite", "getpgid",
             "setsid", "mkfifo"):  # fmt: skip
    if hasattr(os, name):
        delattr(os, name)
