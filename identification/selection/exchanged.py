"""Starts at which the filter of a sensor has another of the three lags of its channel.

At a constant Kt and with little friction, the current logged through a filter is

    i(s) / v(s) = (J / Kt^2) s / ((1 + s t1) (1 + s t2) (1 + s t3)),

where two of the times are those of the motor,

    t1 + t2 = J Ra / Kt^2,   t1 t2 = J L / Kt^2,

and the third is that of the filter.  Each of the three may be the one of the filter: with the same
Kt and J, and other Ra and L, the logged current is the same.  The logged speed has the same three
times behind a filter of its own.  Only the other channel, which has two of them, decides, and the
three optima are apart, so that a fit from one of them does not reach another.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from identification.effects.sensor import CurrentFilter, SpeedFilter
from identification.fit.solve import Fit
from identification.selection.start import Along, Start

__all__ = ["exchanged"]

_LEAST: Final = 0.1
"""Least part of its lag that a filter keeps at a start [-]."""


def exchanged(fit: Fit) -> list[Start]:
    """Starts with the other two lags in each first-order filter of a sensor that the model has.

    If the other sensor has a filter, it takes what the motor has lost, so that its channel keeps
    the sum of its lags.  A motor whose current oscillates has no lags to exchange.
    """
    at = fit.by_name
    whole = at["J"] * at["Ra25"] / at["Kt25"] ** 2
    apart = 1.0 - 4.0 * at["L"] / (at["Ra25"] * whole)
    if not (np.isfinite(apart) and apart > 0.0):
        return []
    longer = 0.5 * whole * (1.0 + np.sqrt(apart))
    starts = []
    for own, other in ((CurrentFilter, SpeedFilter), (SpeedFilter, CurrentFilter)):
        own_name, other_name = (f"{law.name}.time_constant" for law in (own, other))
        if not any(isinstance(term, own) and term.order == 1 for term in fit.simulator.model.terms):
            continue
        lag = at[own_name]
        for taken, kept in ((longer, whole - longer), (whole - longer, longer)):
            resistance = at["Ra25"] * (kept + lag) / whole
            there = at | {own_name: taken, "Ra25": resistance}
            there["L"] = resistance * kept * lag / (kept + lag)
            if other_name in at:
                there[other_name] = max(at[other_name] + taken - lag, _LEAST * at[other_name])
            values = np.array([there[name] for name in fit.coordinates.names])
            starts.append(Start(np.zeros(0), along=Along.to(fit, values), is_moved=True))
    return starts
