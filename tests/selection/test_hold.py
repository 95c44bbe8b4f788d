"""Score of the hold of the voltage."""

import pytest

from identification.effects.sensor import InputHold
from identification.fit.declared import fit_declared
from identification.model.excitation import records_of
from identification.selection.score import with_fitted_hold
from identification.selection.screen import screened
from tests.motors import campaign, motor_named


def test_the_gain_of_another_hold_is_that_of_a_fit() -> None:
    """A motor driven by slow waves: the prediction misses most of the gain, the fit none."""
    motor = motor_named("servo 100 W")
    records = records_of(campaign(motor, seed=4, kind="multisine", hold="foh"))
    held, ramped = (fit_declared(records, hold) for hold in ("zoh", "foh"))
    (predicted,) = screened(held, InputHold.candidates(None))  # type: ignore[arg-type]
    (fitted,) = with_fitted_hold(held, [predicted])
    assert predicted.gain < 0.8 * fitted.gain
    assert fitted.gain == pytest.approx(held.cost - ramped.cost)
    assert fitted.starts[0].along is not None


def test_a_fit_of_the_wrong_hold_changes_no_prediction() -> None:
    """A motor driven by held steps: the other hold fits worse, and its score stays."""
    motor = motor_named("servo 100 W")
    held = fit_declared(records_of(campaign(motor, seed=4)), "zoh")
    predicted = screened(held, InputHold.candidates(None))  # type: ignore[arg-type]
    assert with_fitted_hold(held, predicted) == predicted
