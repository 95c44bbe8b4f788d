"""Runs as a caller gives them: runs, paths or DataFrames, one or several."""

from __future__ import annotations

import os
from collections.abc import Iterable

import pandas as pd

from identification.errors import InputError
from identification.ingest.file import Limits
from identification.ingest.mapping import MappingLike
from identification.ingest.read import read_run
from identification.ingest.run import Run

__all__ = ["RunLike", "each_given", "run_of", "runs_of"]

RunLike = Run | str | os.PathLike[str] | pd.DataFrame
"""A run, the path of its file, or a table of its samples."""

_SINGLE = (Run, str, os.PathLike, pd.DataFrame)


def each_given(given: RunLike | Iterable[RunLike], role: str) -> list[RunLike]:
    """List of what was given, alone or in an iterable, as the argument `role`.

    Raises:
        InputError: An object is none of these.
    """
    several = [given] if isinstance(given, _SINGLE) or not isinstance(given, Iterable) else given
    runs: list[RunLike] = []
    for one in several:
        if not isinstance(one, _SINGLE):
            raise InputError(
                f"{role} has an object of type {type(one).__name__}; expected a Run, as read_run "
                "returns it, the path of a run file, or a DataFrame",
                value=repr(one)[:80],
            )
        runs.append(one)
    return runs


def run_of(
    given: RunLike,
    name: str | None = None,
    mapping: MappingLike | None = None,
    limits: Limits | None = None,
) -> Run:
    """The run that was given; a file or a DataFrame is read, see `read_run`.

    Raises:
        RunFileError: The file or the DataFrame is no run.
    """
    if isinstance(given, Run):
        return given
    return read_run(given, name=name, mapping=mapping, limits=limits)


def runs_of(given: RunLike | Iterable[RunLike], role: str) -> list[Run]:
    """All runs that were given; a DataFrame is named by its role and number.

    Raises:
        InputError: An object is none of these, or no run.
    """
    return [
        run_of(one, f"{role} {number}" if isinstance(one, pd.DataFrame) else None)
        for number, one in enumerate(each_given(given, role), start=1)
    ]
