"""Consider covariance of transients that pass within a sample interval.

If the motor settles within a sample interval, each sample shows only what is left of two transients
that overlap.  The runs then determine a curve of resistances, inertias and inductances that fit
nearly equally well, and the covariance at the optimum covers only a part of it.  All parameters are
therefore refitted with a tenth of the inductance.  If the log likelihood falls by less than the
limit, the change of every parameter over sqrt(max(2 d, 1)), with the loss d, joins the intervals,
as that of a confounded lag (`selection.confounded`).

Source: Venzon and Moolgavkar, Applied Statistics 37 (1988), 87-94 (profile likelihood).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from identification.fit.solve import Fit, TerminationLimits, solve
from identification.model.excitation import sample_interval
from identification.model.parameter import Coordinates
from identification.selection.omitted import OmittedTerm
from identification.selection.policy import DEFAULT, SelectionPolicy

__all__ = ["unresolved_transients"]


def unresolved_transients(
    fit: Fit, fraction: float, policy: SelectionPolicy = DEFAULT
) -> tuple[OmittedTerm, ...]:
    """Parameter changes to a motor with a tenth of the inductance, unless the runs exclude it."""
    at, interval = fit.by_name, sample_interval(fit.simulator.records)
    slow = at["J"] / (at["b"] + at["Kt25"] ** 2 / at["Ra25"])
    row = fit.coordinates.names.index("L")
    if slow >= interval or fit.coordinates.parameters[row].origin:
        return ()
    position = fit.position.copy()
    values = fit.values.copy()
    values[row] *= policy.remaining_lag
    position[row] = fit.coordinates.of(values)[row]
    parameters = list(fit.coordinates.parameters)
    parameters[row] = replace(parameters[row], lower=values[row], upper=values[row])
    limits = TerminationLimits(policy.steps, fit.cost + policy.exclusion_loss / fraction)
    coordinates = Coordinates(parameters)
    simulator = fit.simulator.suited_to(values)
    found = solve(simulator, coordinates, position, fit.states, fit.weighting, limits)
    loss = fraction * (found.cost - fit.cost)
    if not loss < policy.exclusion_loss:
        return ()
    step = (found.position - fit.position) / np.sqrt(max(2.0 * loss, 1.0))
    steps = dict(zip(fit.coordinates.names, map(float, step), strict=True))
    time = float(found.values[row] / at["Ra25"])
    return (OmittedTerm("unresolved_transient", None, None, steps, time=time),)
