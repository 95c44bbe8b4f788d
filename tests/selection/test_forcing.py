"""Response to small forces along a trajectory, compared with simulations of the forced motor."""

from __future__ import annotations

import numpy as np
import pytest

from bench import make_campaign
from benchmarks.coverage import run_of
from identification.effects.friction import CoulombFriction
from identification.effects.load import LoadTorque
from identification.effects.zero import VoltageOffset
from identification.fit.campaign import campaign_of
from identification.fit.declared import fit_declared
from identification.fit.solve import Fit
from identification.model.simulate import Simulator
from identification.model.term import AbstractTerm
from identification.selection.forcing import responses
from identification.selection.refit import refined, refitted_with
from identification.selection.start import Start

SIZE = 1e-4


@pytest.fixture(scope="module")
def fit() -> Fit:
    """Fit of a nominal motor."""
    measured = make_campaign("servo_150w", [], seed=3, rows=600, training=2, validation=1)
    runs = [run_of(run, f"t{k}.csv") for k, run in enumerate(measured.training)]
    return fit_declared(campaign_of(runs, []).training, "zoh")


def pushed(fit: Fit, term: AbstractTerm, size: float) -> list[np.ndarray]:
    """Change of the simulation by a term of that amplitude."""
    simulator = Simulator(
        fit.simulator.model.adding(term),
        fit.simulator.records,
        fit.simulator.plan,
        fit.simulator.substeps,
    )
    values = np.append(fit.values, size)[:, None]
    rest = np.append(fit.values, 0.0)[:, None]
    pairs = zip(
        simulator.logged(values, fit.states), simulator.logged(rest, fit.states), strict=True
    )
    return [(with_it - without)[:, :, 0] for with_it, without in pairs]


@pytest.mark.parametrize("stride", [1, 7])
def test_a_torque_moves_the_motor_as_a_load_does(fit: Fit, stride: int) -> None:
    """A constant torque is a load; the reference is its simulation."""
    expected = pushed(fit, LoadTorque(1.0), SIZE)
    rows = [record.rows for record in fit.simulator.records]

    def force(k: int) -> np.ndarray:
        return np.tile([[0.0], [-SIZE]], (rows[k], 1, 1))

    found = list(responses(fit, force, stride))

    for one, other in zip(found, expected, strict=True):
        scale = np.abs(other).max(axis=0)
        np.testing.assert_allclose(one[:, :, 0] / scale, other[::stride] / scale, atol=1e-6)


def test_a_voltage_moves_the_motor_as_an_offset_does(fit: Fit) -> None:
    """A constant voltage is an offset of the logged one; the reference is its simulation."""
    expected = pushed(fit, VoltageOffset(1.0), SIZE)
    rows = [record.rows for record in fit.simulator.records]

    found = list(responses(fit, lambda k: np.tile([[-SIZE], [0.0]], (rows[k], 1, 1))))

    for one, other in zip(found, expected, strict=True):
        scale = np.abs(other).max(axis=0)
        np.testing.assert_allclose(one[:, :, 0] / scale, other / scale, atol=1e-6)


def test_the_response_follows_a_motor_with_substeps() -> None:
    """With dry friction the motor is linear between reversals; the reference is a simulation."""
    measured = make_campaign(
        "servo_150w", [("coulomb_friction", 0.05)], seed=3, rows=600, training=2, validation=1
    )
    runs = [run_of(run, f"t{k}.csv") for k, run in enumerate(measured.training)]
    declared = fit_declared(campaign_of(runs, []).training, "zoh")
    speed = float(
        np.sqrt(np.mean([np.mean(r.measured[:, 1] ** 2) for r in declared.simulator.records]))
    )
    term = CoulombFriction(0.05, 3e-3 * speed)
    fit = refined(refitted_with(declared, term, [Start(np.array([0.01, 0.0]))]))
    assert fit.simulator.substeps is not None
    expected = pushed(fit, LoadTorque(1.0), 1e-6)
    rows = [record.rows for record in fit.simulator.records]

    found = list(responses(fit, lambda k: np.tile([[0.0], [-1e-6]], (rows[k], 1, 1))))

    for one, other in zip(found, expected, strict=True):
        scale = np.abs(other).max(axis=0)
        np.testing.assert_allclose(one[:, :, 0] / scale, other / scale, atol=0.02)
