"""Run as `python -m hapticeval`."""

import sys

try:
    from hapticeval.cli import main
except ModuleNotFoundError as missing:  # a library, or the package's own metadata, which name renderers and suites
    print(
        f"error: hapticeval is not installed for {sys.executable}\n"
        f"  why: {missing}\n"
        "  what to do: type 'make run' in the checkout, then .venv/bin/hapticeval; or 'pip install .', then hapticeval",
        file=sys.stderr,
    )
    sys.exit(2)

sys.exit(main())
