"""What every test shares: no display, Ctrl-C as ever, and hypothesis without deadlines, repeatable in CI."""

from __future__ import annotations

import os
import signal

os.environ.setdefault("MPLBACKEND", "Agg")

from hypothesis import settings

settings.register_profile("local", deadline=None)
settings.register_profile("ci", deadline=None, derandomize=True)
settings.load_profile("ci" if os.environ.get("CI") else "local")

# Started from a background job the tests inherit an ignored SIGINT, and would pass it on to the commands they start.
signal.signal(signal.SIGINT, signal.default_int_handler)
