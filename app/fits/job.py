"""Job description for a computing process: one attempt at one fit.

A computing process has no access to the database, the keys or the settings.  It receives this
description, writes to one directory and reports over a pipe.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Self

from identification.options import FitOptions

__all__ = ["LOG", "OUTPUTS", "OUTPUT_SUMS", "FitJob", "RunFile", "options_of"]

OUTPUTS = ("result.json", "report.html", "posterior.nc")
"""Output files of a fit; the last exists only if the posterior was sampled."""

OUTPUT_SUMS = "SHA256SUMS"
"""File with the SHA-256 of each output, written after them to the same directory."""

LOG = "worker.log"
"""File with what a process has printed."""


@dataclass(frozen=True)
class RunFile:
    """A run as it was accepted."""

    path: str
    name: str
    """Name of the run in the result."""
    mapping: dict[str, Any] | str | None
    """Assignment of columns to channels, the path of its JSON file, or None."""
    sha256: str | None = None
    """SHA-256 of the uploaded bytes; None skips the comparison."""


@dataclass(frozen=True)
class FitJob:
    """One attempt at one fit."""

    fit_id: str
    attempt: int
    """Number of this attempt, counted from 1."""
    directory: str
    training: tuple[RunFile, ...]
    """Training runs, in the order of recording."""
    validation: tuple[RunFile, ...]
    options: dict[str, Any]
    """Fields of `identification.options.FitOptions`, and `bench` if it is known."""
    pipeline: str
    """Function that computes, as module:function."""
    checkpoint_s: float = 10.0
    """Minimum time between two checkpoints [s]."""
    threads: int = 1
    motor: str = ""
    """Name of the motor; empty if unknown."""

    @classmethod
    def of(cls, fields: Mapping[str, Any]) -> Self:
        """Build a job from its fields in JSON form."""
        runs = {
            role: tuple(RunFile(**run) for run in fields[role])
            for role in ("training", "validation")
        }
        return cls(**{**fields, **runs})


def options_of(fields: Mapping[str, Any]) -> FitOptions:
    """Fit options from their fields in JSON form; other fields, such as `bench`, are ignored.

    Raises:
        OptionError: An option is invalid.
    """
    known: dict[str, Any] = {
        name: tuple(value) if isinstance(value, list) else value
        for name, value in fields.items()
        if name in FitOptions.__dataclass_fields__
    }
    return FitOptions(**known)
