"""Reader of JSON lines: an object with names and units, then one array for each sample.

{"columns": ["t", "u", "i", "n"], "units": ["ms", "V", "mA", "rpm"]}
[0.0, 12.01, 1204.0, 0.0]
[1.0, 11.98, 1198.0, 2.9]
"""

from __future__ import annotations

import json

import numpy as np

from identification.errors import NoTable, NotANumber, RaggedRow
from identification.ingest import ArrayTable, RunFile, describe_column


class JsonLinesReader:
    """Reader of files that end in ``.jsonl`` and begin with the object of the columns."""

    def recognises(self, name: str, head: bytes) -> bool:
        """Return True if both the ending and the first bytes are those of the format."""
        return name.lower().endswith(".jsonl") and head.startswith(b'{"columns":')

    def open(self, file: RunFile) -> ArrayTable:
        """Read the whole file; blank cells are null."""
        first, *lines = file.content().decode("utf-8", "replace").splitlines()
        match _parsed(first, 1):
            case {"columns": [*names], "units": [*units]} if len(names) == len(units):
                header = zip(map(str, names), map(str, units), strict=True)
            case _:
                raise NoTable('expected "columns" and "units", one unit for each column', row=1)
        columns = [describe_column(k, [name], [unit]) for k, (name, unit) in enumerate(header)]
        rows = [_sample(line, row, len(columns)) for row, line in enumerate(lines, start=2)]
        cells = np.reshape(np.array(rows, dtype=np.float64), (len(rows), len(columns))).T
        return ArrayTable(columns, tuple(cells), first_row=2)


def _sample(line: str, row: int, count: int) -> list[float | None]:
    cells = _parsed(line, row)
    if not isinstance(cells, list) or len(cells) != count:
        raise RaggedRow(f"expected an array of {count} cells", row=row)
    for cell in cells:
        if isinstance(cell, bool) or not isinstance(cell, float | int | None):
            raise NotANumber(f"{cell!r} is not a number; expected a number or null", row=row)
    return cells


def _parsed(line: str, row: int) -> object:
    try:
        return json.loads(line)
    except ValueError as error:
        raise NoTable("the line is not JSON; expected an object or an array", row=row) from error
