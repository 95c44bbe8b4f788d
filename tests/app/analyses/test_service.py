"""Speed loop of a fit from its stored files."""

from __future__ import annotations

from pathlib import Path
from typing import Any, BinaryIO, cast

import numpy as np
import pytest

from app.access.service import Caller
from app.analyses.service import APPROXIMATE, AnalysisService
from app.errors import NotReady
from app.fits.service import FitService, StoredFit
from app.tables import FitRow
from identification.errors import InputError, OptionError
from identification.quantities import DECLARED_PARAMETERS
from identification.result.draws import write_posterior
from identification.result.entries import parameter_entry

CALLER = Caller("default")
FRICTIONS = (0.1, 0.2, 0.4)
MOTORS = np.array([[0.59, 0.0, 0.071, 0.0, 0.01, b, 0.5] for b in FRICTIONS])
RESULT = {
    "parameters": {
        name: parameter_entry(np.full(3, MOTORS[0, at]), "1", identified=True)
        for at, name in enumerate(DECLARED_PARAMETERS)
    }
}


class StoredFits:
    """One fit with its posterior."""

    def __init__(self, posterior: Path | None, result: dict[str, Any] | None) -> None:
        self._posterior = posterior
        self._result = result

    def get(self, caller: Caller, fit_id: str) -> StoredFit:
        """Return the fit."""
        row = FitRow(id=fit_id, status="succeeded" if self._result else "running")
        return StoredFit(row, [], [], self._posterior is not None, self._result)

    def output(self, caller: Caller, fit_id: str, name: str) -> BinaryIO:
        """Open the posterior."""
        assert self._posterior
        assert name == "posterior.nc"
        return self._posterior.open("rb")


def analyses(posterior: Path | None, result: dict[str, Any] | None = RESULT) -> AnalysisService:
    """Service with this fit only."""
    fits = cast(FitService, StoredFits(posterior, result))
    unused = cast(Any, None)
    return AnalysisService(fits, unused, unused, unused)


@pytest.fixture
def posterior(tmp_path: Path) -> Path:
    """Three draws that differ in the friction."""
    file = tmp_path / "posterior.nc"
    names = list(DECLARED_PARAMETERS)
    write_posterior(
        file, names, ["1"] * 7, MOTORS[:, None, :], np.zeros((3, 1)), acceptance=0.5
    )  # fmt: skip
    return file


@pytest.mark.parametrize("gain", [1.0, 4.0])
def test_final_value_of_each_draw_has_a_closed_form(posterior: Path, gain: float) -> None:
    """A P loop settles at k Kt / (Ra b + Kt^2 + k Kt) of the reference."""
    expected = gain * 0.071 / (0.59 * MOTORS[:, 5] + 0.071**2 + gain * 0.071)

    loop = analyses(posterior).loop(CALLER, "fit_x", [f"P:{gain}"], [25.0], draws=2000)

    [entry], [step] = loop.feedback, loop.steps
    assert entry["steady_state"]["median"] == pytest.approx(np.median(expected))
    assert entry["steady_state"]["sd"] == pytest.approx(np.std(expected))
    assert step.median[0] == pytest.approx(0.0, abs=1e-12)
    assert np.all(step.q05 <= step.q95)
    assert loop.remarks == ()


def test_integral_action_removes_the_error_at_any_temperature(posterior: Path) -> None:
    """Each controller has a metric entry and a curve at each temperature; PI settles at 1."""
    loop = analyses(posterior).loop(CALLER, "fit_x", ["P:1", "PI:1,5"], [0.0, 90.0], draws=2000)

    order = [("P:1", 0.0), ("P:1", 90.0), ("PI:1,5", 0.0), ("PI:1,5", 90.0)]
    assert [(e["controller"], e["temperature_degC"]) for e in loop.feedback] == order
    assert [(s.controller, s.temperature_degC) for s in loop.steps] == order
    for entry in loop.feedback[2:]:
        assert entry["steady_state"]["median"] == pytest.approx(1.0)


def test_fit_without_posterior_is_analysed_with_a_remark() -> None:
    """Draws from medians and standard deviations; here all standard deviations are zero."""
    loop = analyses(None).loop(CALLER, "fit_x", ["P:1"], [25.0], draws=50)

    assert loop.remarks == (APPROXIMATE,)
    assert loop.feedback[0]["steady_state"]["sd"] == pytest.approx(0.0, abs=1e-12)


def test_unfinished_fit_has_no_loop() -> None:
    """The message states the status."""
    with pytest.raises(NotReady, match="fit_x is running"):
        analyses(None, None).loop(CALLER, "fit_x", ["P:1"], [25.0], draws=50)


def test_refused_controller_temperature_and_posterior_are_named(tmp_path: Path) -> None:
    """A wrong value is refused before the files are read; a damaged posterior is an error."""
    damaged = tmp_path / "posterior.nc"
    damaged.write_bytes(b"nothing")
    service = analyses(damaged)

    with pytest.raises(OptionError, match="PD:1,2"):
        service.loop(CALLER, "fit_x", ["PD:1,2"], [25.0], draws=50)
    with pytest.raises(OptionError, match="500"):
        service.loop(CALLER, "fit_x", ["P:1"], [500.0], draws=50)
    with pytest.raises(InputError, match=r"posterior\.nc of fit_x"):
        service.loop(CALLER, "fit_x", ["P:1"], [25.0], draws=50)
