"""Detection of runs whose current sensor had a different gain.

The gain of the current sensor is not identifiable from one run.  With Kt from voltage and speed, a
sensor that reads g times the current gives Ra/g, L/g, J g and b g, and the fit is equally good.
Two runs determine the ratio of their gains.  A ratio of gains differs from a hotter winding or
another inertia in that both balances yield the same ratio.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from identification.arrays import Array
from identification.errors import ComputationError
from identification.fit.campaign import Campaign
from identification.fit.declared import fit_declared
from identification.fit.effective_samples import effective_fraction
from identification.fit.evaluate import simulate_fitted, simulate_unseen
from identification.fit.identifiability import identified
from identification.fit.solve import Fit
from identification.model.excitation import Record
from identification.quantities import DECLARED_PARAMETERS
from identification.warning import ResultWarning

__all__ = ["GainRatio", "current_gains", "with_one_gain"]

_LEAST: Final = np.log(1.25)
"""Smallest log ratio that is considered; a winding 65 K hotter has 1.25 times the resistance."""
_AGREE: Final = 0.25
"""Fraction of the log ratio by which the two balances may disagree."""


@dataclass(frozen=True)
class GainRatio:
    """A run whose current sensor reads more or less than in the first training run."""

    run: int
    """Number of the run in the order of recording."""
    name: str
    """File name of the run."""
    ratio: float
    """Reading over that in the first training run, for the same current [-]."""


def current_gains(declared: Fit, campaign: Campaign) -> tuple[GainRatio, ...]:
    """Runs in which both resistance and inertia indicate a different gain of the current sensor.

    The nominal model is fitted to all training runs.
    """
    if not _is_suspected(declared, campaign):
        return ()
    runs: dict[int, list[Record]] = {}
    for record in (*campaign.training, *campaign.validation):
        runs.setdefault(record.run, []).append(record)
    alone = {run: _alone(records, declared) for run, records in runs.items()}
    first = alone[min(runs)]
    found = []
    for run, one in alone.items():
        if first is None or one is None or one is first:
            continue
        by_voltage, same, by_torque = np.log(one[0] / first[0])
        ratio = 0.5 * (by_torque - by_voltage)
        apart = max(abs(by_torque - ratio), abs(by_voltage + ratio), abs(same))
        unsure = max(one[1], first[1])
        if abs(ratio) > _LEAST and max(apart, unsure) < _AGREE * abs(ratio):
            found.append(GainRatio(run, runs[run][0].name, float(np.exp(ratio))))
    return tuple(found)


def _is_suspected(declared: Fit, campaign: Campaign) -> bool:
    """True if the regression of measured on simulated current indicates a gain in any run."""
    simulated = [*simulate_fitted(declared), *simulate_unseen(declared, campaign.validation)]
    if len({one.record.run for one in simulated}) < 2:
        return False
    for one in simulated:
        weight, current = one.record.weight[:, 0], one.logged[:, 0]
        size = float(np.sum(weight * current**2))
        slope = float(np.sum(weight * current * one.record.measured[:, 0])) / max(size, 1e-300)
        if not np.exp(-0.5 * _LEAST) < slope < np.exp(0.5 * _LEAST):
            return True
    return False


def with_one_gain(campaign: Campaign, gains: Sequence[GainRatio]) -> Campaign:
    """The campaign with all currents scaled to the gain of the first training run."""
    if not gains:
        return campaign
    ratios = {gain.run: gain.ratio for gain in gains}
    training, validation = (
        tuple(replace(r, measured=r.measured / [ratios.get(r.run, 1.0), 1.0]) for r in records)
        for records in (campaign.training, campaign.validation)
    )
    runs = ", ".join(f"{gain.name} ({gain.ratio:.3g} times)" for gain in gains)
    message = (
        f"the gain of the current sensor is not determined: for the same current it reads "
        f"differently in {runs} than in {campaign.training[0].name}; all runs were taken as the "
        "latter reads them, so Ra25, L, J, b and torques are known up to that gain"
    )
    return replace(
        campaign,
        training=training,
        validation=validation,
        warnings=(*campaign.warnings, ResultWarning("unknown_current_gain", "warning", message)),
    )


def _alone(records: Sequence[Record], declared: Fit) -> tuple[Array, float] | None:
    """Ra25, Kt25 and J of one run fitted alone, and their largest relative standard deviation.

    None if that fit fails, or if the run does not determine all three: a current of nothing but
    noise, as of a motor that coasts with open terminals, fits any gain below one.
    """
    try:
        fit = fit_declared(records, declared.simulator.model.hold)
    except ComputationError:
        return None
    names = ("Ra25", "Kt25", "J")
    chosen = [list(DECLARED_PARAMETERS).index(name) for name in names]
    values = fit.values[chosen]
    determined = identified(fit, effective_fraction(fit))
    if not (fit.converged and np.all(values > 0) and all(determined[name] for name in names)):
        return None
    return values, float(np.max(fit.deviations[chosen] / values))
