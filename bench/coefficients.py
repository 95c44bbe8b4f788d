"""Resistance, torque constant and saturation factor of the hidden plant (compiled)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numba import njit

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["fall", "magnet_temperature", "resistance", "torque_constant"]


@njit(error_model="numpy")
def _winding_temperature(y: NDArray[np.float64], p: Any, logged: float) -> float:
    """Winding temperature: the logged temperature after its lag, plus self-heating [degC]."""
    base = logged
    if p.winding_lag > 0.0:
        base = y[4] if p.winding_lag_order > 1.5 else y[3]
    return base + y[5] + y[6]


@njit(error_model="numpy")
def magnet_temperature(y: NDArray[np.float64], p: Any, logged: float) -> float:
    """Magnet temperature: the logged temperature after its lag, if there is one [degC]."""
    if p.magnet_lag > 0.0:
        return y[8] if p.magnet_lag_order > 1.5 else y[7]
    return logged


@njit(error_model="numpy")
def fall(x: float, k: float, power: float, exponential: float) -> float:
    """Saturation factor 1/(1 + k x^power) or exp(-k x^power) [-]."""
    if k == 0.0:
        return 1.0
    if exponential > 0.5:
        return np.exp(-k * x**power)
    return 1.0 / (1.0 + k * x**power)


@njit(error_model="numpy")
def resistance(y: NDArray[np.float64], p: Any, logged: float) -> float:
    """Armature resistance at the winding temperature [ohm]."""
    rise = _winding_temperature(y, p, logged) - 25.0
    return p.Ra25 * (1.0 + rise * (p.alpha_Ra + rise * (p.curvature + rise * p.curvature_cubic)))


@njit(error_model="numpy")
def torque_constant(y: NDArray[np.float64], p: Any, logged: float, peak: float) -> float:
    """Torque and back-EMF constant with temperature, saturation and demagnetisation [N m/A]."""
    rise = magnet_temperature(y, p, logged) - 25.0
    constant = p.Kt25 * (1.0 + p.alpha_Kt * rise)
    if p.demagnetization > 0.0 and peak > p.demagnetization_from:
        share = 1.0
        if p.demagnetization_to > p.demagnetization_from:
            span = p.demagnetization_to - p.demagnetization_from
            share = min(1.0, (peak - p.demagnetization_from) / span)
        constant *= 1.0 - p.demagnetization * share
    return constant * fall(abs(y[0]) / p.rated_current, p.flux, p.flux_power, p.flux_exponential)
