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
