"""Run as `python -m hapticeval`."""

import sys

from hapticeval.cli import main

sys.exit(main())
