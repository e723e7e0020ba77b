"""Other people's files, read as tables of raw columns: one module a format.

A format of your own is a function that takes a path and gives a `Table`, told to `importer`:

    from hapticeval.recordings.formats import Table, importer

    @importer("acme", about="log of an ACME stick", suffixes=(".acme",))
    def read_acme(path):
        rows = [line.split("|") for line in path.read_text().splitlines()]
        return Table(
            {"t": [float(row[0]) for row in rows], "x": [float(row[1]) for row in rows]},
            units={"t": "ms"},
        )

It says what the file says and no more: a unit that the file does not state is left out, and the mapping gives it.
Columns have a number in each row, nan where the file has none; of signals on several clocks each has its clock, and
`topics` tells which columns were taken together. On the command line it is named `--format mymodule:read_acme`, which
no mapping may do; an installed package offers it by an entry point of the group `hapticeval.formats`.
"""

from __future__ import annotations

from hapticeval.recordings.formats.registry import Format, formats, importer, read_table
from hapticeval.recordings.formats.table import Table

__all__ = ["Format", "Table", "formats", "importer", "read_table"]
