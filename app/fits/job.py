"""What a computing process is told: one attempt at one fit.

A process that computes knows no database, no keys and no settings; it gets this, writes into one
directory and reports over a pipe.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Self

__all__ = ["CHECKPOINTS", "LOG", "OUTPUTS", "OUTPUT_SUMS", "Job", "RunFile"]

CHECKPOINTS = "checkpoints"
"""Directory beside those of the attempts: what each has so far, in a file named by its number."""

OUTPUTS = ("result.json", "report.html", "posterior.nc")
"""Files that a fit may leave; the last only where the posterior was sampled."""

OUTPUT_SUMS = "SHA256SUMS"
"""File beside the outputs with the SHA-256 of each; written after them."""

LOG = "worker.log"
"""File that holds what a process printed."""


@dataclass(frozen=True)
class RunFile:
    """A run as it was accepted.

    Args:
        path: Where its bytes are.
        name: What the result calls it.
        mapping: Which column is which channel, or None.
        sha256: Hash of the bytes as they were uploaded; where it is None they are not compared.
    """

    path: str
    name: str
    mapping: dict[str, Any] | None
    sha256: str | None = None


@dataclass(frozen=True)
class Job:
    """One attempt at one fit.

    Args:
        fit_id: The fit.
        attempt: Which attempt this is, counted from 1.
        directory: Where the outputs go.
        training: Runs to fit, in the order of recording.
        validation: Runs to check the model on.
        options: Fields of `identification.options.FitOptions`.
        pipeline: Function that computes, as module:function.
        checkpoint_s: Least time between two savings of what it has so far [s].
        threads: Threads that it may use.
    """

    fit_id: str
    attempt: int
    directory: str
    training: tuple[RunFile, ...]
    validation: tuple[RunFile, ...]
    options: dict[str, Any]
    pipeline: str
    checkpoint_s: float = 10.0
    threads: int = 1

    @classmethod
    def of(cls, fields: Mapping[str, Any]) -> Self:
        """A job from its fields as JSON has them."""
        runs = {
            role: tuple(RunFile(**run) for run in fields[role])
            for role in ("training", "validation")
        }
        return cls(**{**fields, **runs})
