"""What a computing process is told: one attempt at one fit, as a file of JSON.

A process that computes knows no database, no keys and no settings; it reads this, writes into one
directory and reports over a pipe.
"""

from __future__ import annotations

import dataclasses
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

__all__ = ["OUTPUTS", "Job", "RunFile"]

OUTPUTS = ("result.json", "report.html", "posterior.nc")
"""Files that a fit may leave; the last only where the posterior was sampled."""


@dataclass(frozen=True)
class RunFile:
    """A run as it was accepted.

    Args:
        path: Where its bytes are.
        name: What the result calls it.
        mapping: Which column is which channel, or None.
    """

    path: str
    name: str
    mapping: dict[str, Any] | None


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
    """

    fit_id: str
    attempt: int
    directory: str
    training: tuple[RunFile, ...]
    validation: tuple[RunFile, ...]
    options: dict[str, Any]
    pipeline: str

    def save(self, path: Path) -> None:
        """Write the job to a file."""
        path.write_text(json.dumps(dataclasses.asdict(self)), encoding="utf-8")

    @classmethod
    def load(cls, path: Path) -> Self:
        """The job in a file."""
        fields = json.loads(path.read_text(encoding="utf-8"))
        for role in ("training", "validation"):
            fields[role] = tuple(RunFile(**run) for run in fields[role])
        return cls(**fields)
