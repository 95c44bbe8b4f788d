"""Accuracy of the simulations by which candidates are scored."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identification.effects.thermal import SelfHeating
from identification.fit.declared import fit_declared
from identification.fit.solve import TerminationLimits, optimised
from identification.model.excitation import records_of
from identification.model.parameter import Coordinates
from identification.model.substeps import evenly
from identification.selection.candidates import scales_of
from identification.selection.projection import gains_of
from identification.selection.screen import screened
from tests.motors import campaign, motor_named


@pytest.mark.parametrize("rise", [0.0, 1e5])
def test_a_stiff_model_has_scores(rise: float) -> None:
    """A winding that heats very much within 5 ms diverges with two substeps a sample."""
    motor = motor_named("servo 100 W")
    declared = fit_declared(records_of(campaign(motor, seed=5, runs=2, rows=600)), "zoh")
    scales = scales_of(declared)
    heat = SelfHeating.candidates(scales)[0].final
    model = declared.simulator.model.adding(heat)
    values = np.append(declared.values, [rise / scales.current**2, 0.005])
    simulator = declared.simulator.changed_to(model, values)
    simulator = replace(simulator, substeps=evenly([600, 600], 16))
    coordinates = Coordinates([*declared.coordinates.parameters, *model.parameters[-2:]])
    at = coordinates.of(values)
    fit = optimised(simulator, coordinates, at, limits=TerminationLimits(0))

    assert screened(fit, SelfHeating.candidates(scales))


def test_gains_of_blocks_are_those_of_least_squares() -> None:
    """Also of collinear deviations; a block without any deviation has no gain."""
    rng = np.random.default_rng(1)
    deviations = 1e-6 * rng.standard_normal((40, 9, 2))
    deviations[::4, :, 1] = 3.0 * deviations[::4, :, 0]
    residuals = rng.standard_normal((40, 9))
    squares = np.einsum("nki,nkj->nij", deviations, deviations)
    rights = np.einsum("nki,nk->ni", deviations, residuals)
    squares[7], rights[7], rights[9, 0] = 0.0, 0.0, np.nan

    gains, amplitudes = gains_of(squares, rights)

    for k in set(range(40)) - {7, 9}:
        expected, *_ = np.linalg.lstsq(deviations[k], residuals[k], rcond=1e-8)
        explained = deviations[k] @ expected
        assert gains[k] == pytest.approx(0.5 * explained @ residuals[k], rel=1e-6)
        assert deviations[k] @ amplitudes[k] == pytest.approx(explained, rel=1e-5, abs=1e-9)
    assert np.isnan(gains[[7, 9]]).all()
