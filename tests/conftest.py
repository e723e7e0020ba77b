"""What every test shares: no display, Ctrl-C as ever, and hypothesis without deadlines, repeatable in CI."""

from __future__ import annotations

import os
import signal

os.environ.setdefault("MPLBACKEND", "Agg")

from hypothesis import HealthCheck, settings

# No clock decides a test: neither a deadline, nor how long examples take to draw.
UNTIMED = {"deadline": None, "suppress_health_check": [HealthCheck.too_slow]}
settings.register_profile("local", **UNTIMED)
settings.register_profile("ci", **UNTIMED, derandomize=True)
settings.load_profile("ci" if os.environ.get("CI") else "local")

# Started from a background job the tests inherit an ignored SIGINT, and would pass it on to the commands they start.
signal.signal(signal.SIGINT, signal.default_int_handler)
