"""Run file reader: parse, convert to SI units and check measured runs.

    run = read_run("run1.csv")
    run = read_run("scope.csv", mapping={"current_A": {"column": "CH2", "scale": 10.0}})

`read_run` returns a `Run` or raises a `RunFileError` whose message names the fix.
docs/run-files.md lists the accepted formats; docs/write-a-reader.md adds one.
"""

from __future__ import annotations

from identification.ingest.columns import Column, describe_column
from identification.ingest.file import Limits, RunFile
from identification.ingest.mapping import MappingLike, read_mapping
from identification.ingest.read import FEWEST_ROWS, READERS, read_run
from identification.ingest.reader import ArrayTable, Reader, Samples, SourceTable, TableSet
from identification.ingest.run import Run, RunWarning, write_run

__all__ = [
    "FEWEST_ROWS",
    "READERS",
    "ArrayTable",
    "Column",
    "Limits",
    "MappingLike",
    "Reader",
    "Run",
    "RunFile",
    "RunWarning",
    "Samples",
    "SourceTable",
    "TableSet",
    "describe_column",
    "read_mapping",
    "read_run",
    "write_run",
]
