"""Prior of the amplitudes that are free in each record."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from identification.effects.lag import WindingLag
from identification.fit.declared import fit_declared
from identification.fit.own_states import own_cost, state_prior
from identification.model.excitation import records_of
from identification.model.simulate import Simulator, initial_states
from tests.motors import campaign, motor_named

MOTOR = motor_named("servo 100 W")


def _lagging(step: float) -> Simulator:
    """A motor whose thermometer lags and logs 40 K in steps [K]."""
    run = campaign(MOTOR, seed=1)[0]
    logged = step * np.round((30.0 + 40.0 * np.linspace(0.0, 1.0, run.time.size) ** 2) / step)
    (record,) = records_of([replace(run, temperature=logged)])
    fit = fit_declared((record,), "zoh")
    term = WindingLag(0.1, 10.0, "the log lags the winding", float(run.time[-1]), step, step)
    return fit.simulator.changed_to(
        replace(fit.simulator.model, terms=(term,)), np.append(fit.values, 1.0)
    )


def test_the_prior_of_a_record_is_the_quadratic_form_of_its_cost() -> None:
    """Second differences of the cost are the inverse covariance, in the rows of the amplitudes."""
    simulator = _lagging(2.0)
    precision, pull = state_prior(simulator, 0)
    own = slice(2, None)
    state = initial_states(simulator.model, simulator.records[0])
    moves = np.random.default_rng(0).normal(size=(state.size, 20))
    moves[:2] = 0.0

    costs = own_cost(simulator, [state[:, None] + moves]) - own_cost(simulator, [state])

    gradient = precision[own, own] @ state[own] - pull[own]
    curved = 0.5 * np.einsum("il,ij,jl->l", moves[own], precision[own, own], moves[own])
    np.testing.assert_allclose(costs, gradient @ moves[own] + curved, rtol=1e-9)


def test_a_log_in_finer_steps_tells_more() -> None:
    """The levels of a log limit its error; a log without steps does not."""
    steps = (4.0, 1.0)

    told = [np.diag(state_prior(_lagging(step), 0)[0])[2:] * step**2 for step in steps]

    assert np.all(told[1] > told[0])
    fine = _lagging(1.0)
    plain = replace(fine, records=(replace(fine.records[0], coarse_log=None),))
    (term,) = fine.model.terms
    assert term.own_root is not None
    alone = term.own_root.T @ term.own_root / term.states[0].scale ** 2
    np.testing.assert_allclose(state_prior(plain, 0)[0][2:, 2:], alone)
