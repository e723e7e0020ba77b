"""Studies behind choices of ours, as programs: `python -m hapticeval.examples.studies.NAME --help` shows each."""
