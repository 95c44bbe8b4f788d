"""Detection of a channel that was computed from the two others.

Without a tachometer, a speed may have been computed from the voltage and the current with the
resistance and the torque constant of a data sheet,

    w = (v - R i) / K

A fit then takes these values for those of the motor.  Such channels obey v = R i + K w + v0
to the last digits in every sample, without L di/dt and without the noise that the current has.  A
simulation without inductance obeys the balance as well; its current has no noise.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np

from identification.checks.balance import Signals, mean_square, regress
from identification.checks.finding import Finding, refusal
from identification.differences import difference_noise
from identification.ingest.run import Run

__all__ = ["computed_findings"]

_EXACT: Final = 1e-5
"""Residual of the balance, over the standard deviation of the voltage, below which it is exact: no
sensor of current and speed measures to 10 ppm."""
_LEAST: Final = 0.1
"""Least share of each of the two terms in the voltage: another channel then matters."""
_FEWEST: Final = 100
_NOISY: Final = 1e-4
"""Least noise of a measured current, over its standard deviation."""
_ORDER: Final = 4
"""Order of the differences in which a current is nothing but its noise."""


def computed_findings(run: Run, signals: Signals) -> Iterator[Finding]:
    """Finding for channels of which one was computed from the two others."""
    noise = difference_noise([signals.current], _ORDER)
    if signals.time.size < _FEWEST or noise < _NOISY * np.std(signals.current):
        return
    fit = regress(signals.voltage, [signals.current, signals.speed])
    if fit is None or np.any(fit.values <= 0.0) or np.any(fit.shares < _LEAST):
        return
    resistance, constant = fit.values.tolist()
    rest = signals.voltage - resistance * signals.current - constant * signals.speed
    exact = float(np.sqrt(mean_square(rest - rest.mean())) / np.std(signals.voltage))
    if exact < _EXACT:
        yield refusal(
            "computed_channel",
            run,
            "speed_rad_s",
            "is computed, or the voltage or the current is: v = R i + K w holds in every sample, "
            f"with R = {resistance:.5g} ohm and K = {constant:.5g} V s/rad, without the noise of a "
            "sensor and without L di/dt; a fit would take these values for those of the motor",
            ("residual relative to the voltage", exact, _EXACT),
            remedy="log a measured speed",
        )
