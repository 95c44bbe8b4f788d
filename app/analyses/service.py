"""Analysis service: what a result says beyond the requested metrics.

Nothing here is stored: each analysis follows from stored results, so a page of it survives a
reload and can be shared by its address.
"""

from __future__ import annotations

import io
import tempfile
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, BinaryIO, Final, cast

from app.access.service import Caller
from app.analyses.prediction import Design, Prediction, Predictor
from app.batches.service import refits_of
from app.errors import FileLost, NotReady, Unavailable
from app.fits.service import FitService, StoredFit
from app.runs.service import RunService
from app.storage import Storage, refused_when_full
from app.tables import RunRow
from identification.fleet.refit import Refit

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from identification.speed_loop import StepCurve

__all__ = ["APPROXIMATE", "AnalysisService", "LoopAnalysis"]

APPROXIMATE: Final = (
    "The fit has no posterior: normal draws from its medians, standard deviations and correlations "
    "are used, so the intervals are approximate."
)
"""Remark on a loop whose draws are a normal approximation."""

_AT_ONCE: Final = 2
_WAIT_S: Final = 20.0


@dataclass(frozen=True)
class LoopAnalysis:
    """Speed loop of an identified motor."""

    feedback: Sequence[Mapping[str, Any]]
    """The list as in result.json: metrics of each controller at each temperature."""
    steps: Sequence[StepCurve]
    """Step response of each, with its 90 % band."""
    remarks: tuple[str, ...] = ()
    """Limits of the numbers, in words."""


class AnalysisService:
    """Analyses of succeeded fits; each is restricted to the workspace of its caller.

    `NotFound` is raised for an ID that this workspace does not have, `NotReady` for a fit that has
    not succeeded, `FileLost` for a file that is missing or damaged, `InputError` for a result or an
    option that is not accepted, and `Unavailable` if too many analyses are computed at the moment.
    """

    def __init__(
        self, fits: FitService, runs: RunService, storage: Storage, predictor: Predictor
    ) -> None:
        self._fits = fits
        self._runs = runs
        self._storage = storage
        self._predictor = predictor
        self._free = threading.BoundedSemaphore(_AT_ONCE)

    def tuning(
        self,
        caller: Caller,
        fit_id: str,
        specification: Mapping[str, float],
        *,
        draws: int,
        is_wanted: Callable[[], bool] = lambda: True,
        **options: Any,
    ) -> tuple[Mapping[str, Any], tuple[str, ...]]:
        """Controllers as `identification.tuning.tune` finds them, and limits of the numbers.

        Raises:
            RunRefused: The computation exceeds the limits.
        """
        from identification.tuning import parse_specification

        parse_specification(specification)  # Refuses here what the process would refuse later.
        fit = self.succeeded(caller, fit_id)
        with self._turn():
            motors = self._draws(caller, fit, draws)
            task = {
                "draws": {name: values.tolist() for name, values in motors.items()},
                "result": fit.result or {},
                "specification": specification,
                "options": options,
            }
            found = self._predictor.answer("tuning", "the tuning", task, is_wanted)
        return found, () if fit.has_posterior else (APPROXIMATE,)

    def loop(
        self,
        caller: Caller,
        fit_id: str,
        controllers: Sequence[str],
        temperatures: Sequence[float],
        *,
        draws: int,
    ) -> LoopAnalysis:
        """Speed loop of the motor with other controllers, at other temperatures [degC]."""
        # Lazy imports: numpy and scipy would slow down every start.
        from identification.speed_loop import feedback_metrics, parse_controllers, step_curves
        from identification.speed_loop.spread import checked_temperatures

        parsed, asked = parse_controllers(controllers), checked_temperatures(temperatures)
        fit = self.succeeded(caller, fit_id)
        with self._turn():
            motors = self._draws(caller, fit, draws)
            return LoopAnalysis(
                feedback_metrics(motors, asked, parsed),
                step_curves(motors, asked, parsed),
                () if fit.has_posterior else (APPROXIMATE,),
            )

    def _draws(self, caller: Caller, fit: StoredFit, most: int) -> dict[str, NDArray[np.float64]]:
        """Draws of the posterior; independent normal draws if there is none."""
        from identification.result.draws import chain_draws, normal_draws

        name = fit.row.id
        if not fit.has_posterior:
            return normal_draws(fit.result or {}, most, f"result.json of {name}")
        with self._fits.output(caller, name, "posterior.nc") as file:
            return chain_draws(file, most, f"posterior.nc of {name}")

    def prediction(
        self,
        caller: Caller,
        fit_id: str,
        run_id: str,
        *,
        declared: bool = False,
        table: BinaryIO | None = None,
        is_wanted: Callable[[], bool] = lambda: True,
    ) -> tuple[RunRow, Prediction]:
        """Simulate a stored run with the model of a fit, and compare it with the measurement.

        A table that is given receives the simulated samples as CSV.

        Raises:
            RunRefused: The prediction exceeds the limits, or the result does not allow it.
        """
        fit = self.succeeded(caller, fit_id)
        run = self._runs.get(caller, run_id)
        if not self._storage.has_run(run.id, run.bytes, run.sha256):
            raise FileLost(
                f"the stored run {run.id} is missing or damaged; upload {run.file} again to "
                "restore it"
            )
        task = {
            "path": str(self._storage.run(run.id)),
            "name": run.file,
            "mapping": run.mapping,
            "result": fit.result or {},
            "declared": declared,
            "has_table": table is not None,
        }
        with self._turn():
            found = self._predictor.answer("prediction", run.file, task, is_wanted, table)
        return run, Prediction(**found)

    def prediction_table(
        self, caller: Caller, fit_id: str, run_id: str, **options: Any
    ) -> BinaryIO:
        """The table of a prediction as an open CSV file, as `motorid predict` writes it.

        Raises:
            StorageFull: No disk space is left.
        """
        # An unnamed file: the table of a long run does not fit into memory.
        with refused_when_full("table"), ExitStack() as stack:
            unnamed = tempfile.TemporaryFile(dir=self._storage.incoming)
            table = cast(BinaryIO, stack.enter_context(unnamed))
            self.prediction(caller, fit_id, run_id, table=table, **options)
            table.flush()
            table.seek(0)
            stack.pop_all()
            return table

    def design(
        self,
        caller: Caller,
        fit_id: str | None,
        options: Mapping[str, Any],
        nameplate: str = "",
        *,
        is_wanted: Callable[[], bool] = lambda: True,
    ) -> Design:
        """Design the next run of the motor of a fit, or the first run of a nameplate.

        The options are fields of `identification.design.DesignOptions`.

        Raises:
            RunRefused: The result or the limits do not allow a design.
        """
        from identification.design import DesignOptions

        DesignOptions(**options)  # Refuses here what the process would refuse later.
        result = None if fit_id is None else self.succeeded(caller, fit_id).result or {}
        task = {"options": options, "nameplate": nameplate, "result": result}
        table = io.BytesIO()
        with self._turn():
            entry = self._predictor.answer("design", "the next run", task, is_wanted, table)
        return Design(entry, table.getvalue().decode())

    def succeeded(self, caller: Caller, fit_id: str) -> StoredFit:
        """Succeeded fit with its result."""
        fit = self._fits.get(caller, fit_id)
        if fit.result is None:
            raise NotReady(
                f"the fit {fit_id} is {fit.row.status}; only a succeeded fit has a result"
            )
        return fit

    def history(
        self, caller: Caller, motor: str, *, after: str | None = None, limit: int
    ) -> tuple[list[StoredFit], list[Refit], str | None]:
        """Page of fits of a motor, newest first, with the cursor of the next page, if any.

        The second value has the compared parts of the succeeded ones.
        """
        fits, older = self._fits.page(caller, after=after, limit=limit, motor=motor)
        rows = [fit.row for fit in fits if fit.row.status == "succeeded"]
        return fits, refits_of(self._storage, rows, {}), older

    @contextmanager
    def _turn(self) -> Iterator[None]:
        """Limit the analyses that are computed at the same time."""
        if not self._free.acquire(timeout=_WAIT_S):
            raise Unavailable("too many analyses are being computed; try again in a few seconds")
        try:
            yield
        finally:
            self._free.release()
