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
from identification.fit.effective_samples import effective_fraction
from identification.fit.evaluate import voltage_noise_power
from identification.fit.solve import Fit
from identification.ingest.run import Run
from identification.model.composite import Hold
from identification.model.excitation import Record, squares_of
from identification.model.logged_voltage import voltage_step
from identification.model.simulate import Simulator
from identification.warning import ResultWarning

__all__ = ["coarse_voltage_warnings", "with_smooth_voltage"]

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
    logged = [
        declared if hold == fitted else fit_declared(campaign.training, hold) for hold in holds
    ]
    fits = [fit_declared(smooth, hold) for hold in holds]
    step = max(voltage_step(record.column("voltage")) for record in campaign.training)
    if not _is_preferred(fits, logged, is_stepped=step > 0.0):
        return campaign, declared
    falls = np.log(fits[0].weighting.deviation / fits[-1].weighting.deviation)
    after = fits[-1] if np.sum(falls) > _HOLD else fits[0]
    removed = [
        new.column("voltage") - old.column("voltage")
        for new, old in zip(smooth, campaign.training, strict=True)
    ]
    noise = float(np.std(np.concatenate(removed)))
    steps = f"steps of {step:.3g} V, which add " if step else ""
    message = (
        f"voltage_V has {steps}noise of {noise:.2g} V that current and speed do not follow; it was "
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


def _is_preferred(smooth: Sequence[Fit], logged: Sequence[Fit], *, is_stepped: bool) -> bool:
    """True if the smoothed voltage fits better or, with steps, not decisively worse.

    The rounding of a voltage that passes its levels one by one is certain, unless the log is the
    command of a supply with such steps.  What smoothing leaves of it can exceed what it removes and
    makes the residual autocorrelated, so the likelihoods count effective samples.
    """
    best, other = (min(fits, key=lambda fit: fit.cost) for fits in (smooth, logged))
    if not is_stepped:
        return bool(other.cost - best.cost > _ODDS)
    fraction = max(effective_fraction(best), effective_fraction(other))
    return bool(fraction * (other.cost - best.cost) > -_ODDS)


def coarse_voltage_warnings(runs: Sequence[Run], final: Fit) -> tuple[ResultWarning, ...]:
    """Warning that what smoothing leaves of the rounding of the voltage acts in the simulation."""
    error = np.sqrt(voltage_noise_power(final))
    steps = {run.name: step for run in runs if (step := voltage_step(run.voltage))}
    if not steps or not np.any(error > _LEAST * final.weighting.deviation):
        return ()
    message = (
        f"voltage_V is logged in steps of {max(steps.values()):.3g} V; where it varies slowly, its "
        f"rounding is no noise that averages out: it causes {error[0]:.2g} A and {error[1]:.2g} "
        "rad/s of the residuals, and the intervals include it"
    )
    fix = "log the voltage in finer steps"
    return (ResultWarning("coarse_quantisation", "warning", message, fix),)


def _matters(declared: Fit, smooth: Sequence[Record]) -> bool:
    """True if the removed noise changes the simulated current or speed."""
    values = declared.values
    simulator = Simulator.fitting(declared.simulator.model, smooth, values)
    logged = simulator.logged(values[:, None], declared.states)
    before = declared.simulated()
    changes = [new[:, :, 0] - old for new, old in zip(logged, before, strict=True)]
    residuals = [record.measured - old for record, old in zip(smooth, before, strict=True)]
    limit = _LEAST**2 * squares_of(smooth, residuals)
    return bool(np.any(squares_of(smooth, changes) > limit))
