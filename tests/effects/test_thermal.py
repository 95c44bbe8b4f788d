"""Several thermal effects together."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from identification.effects.lag import WindingLag
from identification.effects.thermal import SelfHeating
from identification.model.composite import MotorModel
from identification.model.excitation import records_of
from identification.model.simulate import Simulator, initial_states
from identification.model.term import AbstractTerm
from tests.motors import campaign, motor_named

Array = NDArray[np.float64]


def test_a_winding_that_lags_is_heated_by_its_losses_all_the_same() -> None:
    """The order of the two effects does not matter; the lag alone is another motor."""
    motor = motor_named("servo 100 W")
    records = records_of(campaign(motor, seed=2, runs=1))
    heats, lags = SelfHeating(1.0, 0.01, 10.0), WindingLag(0.01, 10.0)
    values = {"self_heating": [2.0, 0.3], "winding_lag": [0.2]}

    def current(*terms: AbstractTerm) -> Array:
        model = MotorModel(terms)
        own = np.array([*motor.vector, *[v for term in terms for v in values[term.name]]])
        simulator = Simulator.fitting(model, records, own)
        return simulator.logged(own[:, None], [initial_states(model, records[0])])[0][:, 0, 0]

    both = current(heats, lags)

    np.testing.assert_allclose(both, current(lags, heats), rtol=1e-6, atol=1e-6)
    assert np.abs(both - current(lags)).max() > 0.01 * np.abs(both).max()
