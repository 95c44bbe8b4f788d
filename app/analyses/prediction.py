"""Prediction or design of a run, or tuning of a loop, by a process with resource limits.

See `app.analyses.predictor` for the side of the process.
"""

from __future__ import annotations

import io
import signal
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

from app.errors import RunRefused, Unavailable
from app.fork_server.child import ProcessLimits
from app.fork_server.client import ForkServer
from app.tables import RunRow
from identification.errors import InputError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

__all__ = ["Design", "Prediction", "Predictor"]


@dataclass(frozen=True)
class Prediction:
    """Measured and simulated signals of one run."""

    rows: int
    """Number of samples of the run."""
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
    """Predictor of runs and loops in child processes of a fork server for `app.analyses.predictor`.

    A computation whose answer is no longer wanted is ended.  Each method raises `RunRefused` if the
    computation exceeds the limits or the result or the request does not allow it, and `Unavailable`
    if it cannot be done now.
    """

    def __init__(self, fork_server: ForkServer, limits: ProcessLimits, max_rows: int) -> None:
        self._fork_server = fork_server
        self._limits = limits
        self._max_rows = max_rows

    def predict(
        self,
        run: RunRow,
        path: Path,
        result: Mapping[str, Any],
        *,
        declared: bool,
        table: BinaryIO | None = None,
        is_wanted: Callable[[], bool] = lambda: True,
    ) -> Prediction:
        """Simulate a stored run from its inputs, with the nominal or the final model.

        A table that is given receives the simulated samples as CSV.
        """
        task = {
            "path": str(path),
            "name": run.file,
            "mapping": run.mapping,
            "max_rows": self._max_rows,
            "result": result,
            "declared": declared,
            "has_table": table is not None,
        }
        found = self._fork_server.answer(task, self._limits, table, is_wanted)
        if "prediction" in found:
            return Prediction(**found["prediction"])
        raise self._refusal(run.file, found)

    def design(
        self,
        options: Mapping[str, Any],
        nameplate: str,
        result: Mapping[str, Any] | None,
        is_wanted: Callable[[], bool] = lambda: True,
    ) -> Design:
        """Design a run with fields of `DesignOptions`, for a result or else a nameplate."""
        task = {"design": options, "nameplate": nameplate, "result": result}
        table = io.BytesIO()
        found = self._fork_server.answer(task, self._limits, table, is_wanted)
        if "design" in found:
            return Design(found["design"], table.getvalue().decode())
        raise self._refusal("the next run", found, "design")

    def tune(
        self,
        draws: Mapping[str, NDArray[np.float64]],
        result: Mapping[str, Any],
        specification: Mapping[str, float],
        options: Mapping[str, Any],
        is_wanted: Callable[[], bool] = lambda: True,
    ) -> Mapping[str, Any]:
        """Tune a speed loop with draws (n_draw,) and arguments of `identification.tuning.tune`.

        Raises:
            InputError: The result or an option is not accepted.
        """
        task = {
            "tuning": options,
            "draws": {name: values.tolist() for name, values in draws.items()},
            "specification": specification,
            "result": result,
        }
        found = self._fork_server.answer(task, self._limits, None, is_wanted)
        if "tuning" in found:
            tuning: Mapping[str, Any] = found["tuning"]
            return tuning
        detail = (found.get("error") or {}).get("detail", "memory")
        if detail != "memory":
            raise InputError(detail)
        raise self._refusal("the tuning", found, "tune")

    def stop(self) -> None:
        """Stop the fork server."""
        self._fork_server.stop()

    def _refusal(
        self, file: str, found: Mapping[str, Any], command: str = "predict"
    ) -> RunRefused | Unavailable:
        """Build the error for a process that ended without a prediction or a design."""
        detail, end = (found.get("error") or {}).get("detail"), found.get("exit")
        limit = self._limits.exceeded(-signal.SIGKILL if detail == "memory" else end)
        if end is None and detail is None:
            return Unavailable("the run could not be computed; try again")
        text = detail or f"{file}: the computation crashed; expected a run of this motor"
        if limit:
            text = f"{file}: the computation needs more than {limit}; use `motorid {command}`"
        return RunRefused(text, reason="prediction", file=file)
