"""Prediction or design of a run, or tuning of a loop, by a process with resource limits.

See `app.analyses.predictor` for the side of the process.
"""

from __future__ import annotations

import signal
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, BinaryIO, Final, Literal

from app.errors import RunRefused, Unavailable
from app.fork_server.child import ProcessLimits
from app.fork_server.client import ForkServer
from identification.errors import InputError

__all__ = ["Design", "Prediction", "Predictor"]

_COMMANDS: Final = {"prediction": "predict", "design": "design", "tuning": "tune"}


@dataclass(frozen=True)
class Prediction:
    """Measured and simulated signals of one run."""

    rows: int
    errors: Mapping[str, Mapping[str, float | None]]
    """For ``current`` and ``speed``: ``rmse``, ``nrmse`` and ``noise_ratio``, as in result.json;
    null if unknown."""
    plot: Mapping[str, Any]
    """Samples to plot: ``time``, and ``speed`` and ``current`` as pairs of measured and simulated
    values; null where a sample has none."""
    remarks: tuple[str, ...] = ()
    """Limits of the numbers, in words."""


@dataclass(frozen=True)
class Design:
    """Designed run."""

    entry: Mapping[str, Any]
    """Expected gain, as `motorid design` writes it to FILE.json."""
    table: str
    """Samples as CSV."""


class Predictor:
    """Computation in child processes of a fork server for `app.analyses.predictor`."""

    def __init__(self, fork_server: ForkServer, limits: ProcessLimits, max_rows: int) -> None:
        self._fork_server = fork_server
        self._limits = limits
        self._max_rows = max_rows

    def answer(
        self,
        kind: Literal["prediction", "design", "tuning"],
        subject: str,
        task: Mapping[str, Any],
        is_wanted: Callable[[], bool],
        table: BinaryIO | None = None,
    ) -> dict[str, Any]:
        """Answer of a process to a task, whose subject is named in errors.

        A table that is given receives rows as CSV.  A computation whose answer is no longer wanted
        is ended.

        Raises:
            InputError: The result or an option does not allow the tuning.
            RunRefused: The computation exceeds the limits, or the result or the request does not
                allow it.
            Unavailable: It cannot be done now.
        """
        asked = {"kind": kind, "max_rows": self._max_rows, **task}
        found = self._fork_server.answer(asked, self._limits, table, is_wanted)
        if kind in found:
            return dict(found[kind])
        detail, end = (found.get("error") or {}).get("detail"), found.get("exit")
        if end is None and detail is None:
            raise Unavailable("the run could not be computed; try again")
        if kind == "tuning" and detail not in (None, "memory"):
            raise InputError(detail)
        text = detail or f"{subject}: the computation crashed; expected a run of this motor"
        if limit := self._limits.exceeded(-signal.SIGKILL if detail == "memory" else end):
            command = _COMMANDS[kind]
            text = f"{subject}: the computation needs more than {limit}; use `motorid {command}`"
        raise RunRefused(text, reason="prediction", file=subject)
