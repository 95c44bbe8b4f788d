"""Decision whether the runs contain the noise of the logged voltage as a voltage at the motor.

A jitter of the logged voltage is noise of its sensor, or the output of a controller that amplifies
the noise of its own sensor.  Only the current and the speed can tell: the motor follows the second
one.  Nominal models of both kinds have the same parameters, so their likelihoods are comparable.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final, Literal

import numpy as np

from identification.fit.campaign import Campaign
from identification.fit.declared import fit_declared
from identification.fit.evaluate import voltage_noise_power
from identification.fit.solve import Fit
from identification.model.composite import Hold
from identification.model.excitation import Record, squares_of
from identification.model.simulate import Simulator
from identification.warning import ResultWarning

__all__ = ["with_smooth_voltage"]

_ODDS: Final = np.log(100.0)
"""Log likelihood ratio from which the smoothed voltage replaces the logged one; decisive evidence
on the scale of Jeffreys."""
_HOLD: Final = 0.02
"""Fall of the simulation error, summed over both channels, from which a first-order hold replaces a
zero-order hold, as for an effect (decision 0008); an effect that is missing may cause less [-]."""
_LEAST: Final = 0.1
"""Least change of the simulation in standard deviations of the residual.  Noise that contributes
less, one per cent of the variance, causes no bias worth a second fit."""


def with_smooth_voltage(
    campaign: Campaign, declared: Fit, hold: Hold | Literal["auto"]
) -> tuple[Campaign, Fit]:
    """The campaign without the noise of its voltage, if that explains current and speed better.

    ``auto`` stands for an unknown hold.

    A voltage with noise varies slowly, so that another hold looks like a delay of the voltage or a
    filter of the current.  The hold of the nominal model is therefore decided here as well.

    Returns:
        The campaign and the fit of the nominal model to it.
    """
    holds: Sequence[Hold] = ("zoh", "foh") if hold == "auto" else (hold,)
    smooth = [record.with_smooth_voltage() for record in campaign.training]
    if not _matters(declared, smooth):
        return campaign, declared
    fitted = declared.simulator.model.hold
    before = min(
        declared.cost if hold == fitted else fit_declared(campaign.training, hold).cost
        for hold in holds
    )
    fits = [fit_declared(smooth, hold) for hold in holds]
    if not before - min(fit.cost for fit in fits) > _ODDS:
        return campaign, declared
    falls = np.log(fits[0].weighting.deviation / fits[-1].weighting.deviation)
    after = fits[-1] if np.sum(falls) > _HOLD else fits[0]
    removed = [
        new.column("voltage") - old.column("voltage")
        for new, old in zip(smooth, campaign.training, strict=True)
    ]
    noise = float(np.std(np.concatenate(removed)))
    message = (
        f"voltage_V has noise of {noise:.2g} V that current and speed do not follow; it was "
        "smoothed between its jumps, because noise of the voltage biases Ra25 and L"
    )
    smoothed = replace(
        campaign,
        training=tuple(smooth),
        validation=tuple(record.with_smooth_voltage() for record in campaign.validation),
        warnings=(*campaign.warnings, ResultWarning("smoothed_voltage", "note", message)),
        voltage="smoothed",
    )
    if np.all(voltage_noise_power(after) < _LEAST**2 * after.weighting.deviation**2):
        # Too little noise is left to favour any model.
        fitted_to, training, validation = (
            tuple(replace(record, voltage_noise=None) for record in records)
            for records in (after.simulator.records, smoothed.training, smoothed.validation)
        )
        smoothed = replace(smoothed, training=training, validation=validation)
        after = replace(after, simulator=replace(after.simulator, records=fitted_to))
    return smoothed, after


def _matters(declared: Fit, smooth: Sequence[Record]) -> bool:
    """Whether the removed noise changes the simulated current or speed."""
    values = declared.values
    simulator = Simulator.fitting(declared.simulator.model, smooth, values)
    logged = simulator.logged(values[:, None], declared.states)
    before = declared.simulated()
    changes = [new[:, :, 0] - old for new, old in zip(logged, before, strict=True)]
    residuals = [record.measured - old for record, old in zip(smooth, before, strict=True)]
    limit = _LEAST**2 * squares_of(smooth, residuals)
    return bool(np.any(squares_of(smooth, changes) > limit))
