"""Steps of a fit: initial states that alone are wrong, and exploding sensitivities."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from bench import make_campaign
from identification.arrays import Array
from identification.fit import normal_equations as module
from identification.fit.declared import fit_declared
from identification.fit.derivatives import products
from identification.fit.solve import TerminationLimits, optimised
from tests.effects.hidden import records_of_bench


def test_wrong_initial_states_alone_leave_a_step_to_take() -> None:
    """Eliminated initial states do not show in the gradient by the parameters."""
    measured = make_campaign("servo_150w", [], seed=2, rows=400, training=2, validation=0)
    fit = fit_declared(records_of_bench(measured).training, "zoh")
    wrong = (fit.states[0] + 10.0 * fit.weighting.deviation, *fit.states[1:])

    predicted = [
        module.normal_equations(
            fit.simulator, fit.coordinates, fit.position, states, fit.weighting
        ).state_decrement
        for states in (fit.states, wrong)
    ]

    residuals = replace(fit, states=wrong).residuals()
    squares = [
        np.sum((np.concatenate(each) / fit.weighting.deviation) ** 2)
        for each in (fit.residuals(), residuals)
    ]
    assert predicted[0] < 0.1
    assert np.isclose(predicted[1], 0.5 * (squares[1] - squares[0]), rtol=0.05)


@pytest.mark.parametrize(("growth", "is_finite"), [(1e3, True), (1e19, False)])
def test_a_motor_whose_sensitivities_explode_has_no_normal_equations(
    monkeypatch: pytest.MonkeyPatch, growth: float, is_finite: bool
) -> None:
    """Parameters and initial states move the speed alike; the elimination subtracts them."""
    measured = make_campaign("servo_150w", [], seed=2, rows=400, training=1, validation=0)
    fit = fit_declared(records_of_bench(measured).training, "zoh")

    def exploding(*arguments: Any) -> tuple[Array, Array]:
        full, right = products(*arguments)
        added = growth * np.sqrt(np.diag(full))
        return full + np.outer(added, added), right

    monkeypatch.setattr(module, "products", exploding)

    equations = module.normal_equations(
        fit.simulator, fit.coordinates, fit.position, fit.states, fit.weighting
    )
    again = optimised(
        fit.simulator, fit.coordinates, fit.position, fit.states, fit.weighting,
        TerminationLimits(2),
    )  # fmt: skip

    assert equations.is_finite is is_finite
    assert bool(np.isfinite(again.cost)) is is_finite
