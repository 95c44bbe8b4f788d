"""Fits of the nominal model with a spline curve."""

from __future__ import annotations

import numpy as np

from identification.fit.solve import Fit
from identification.selection.candidates import scales_of
from identification.selection.refit import refitted_with
from identification.selection.start import Start
from identification.surrogates.curve import HEIGHTS, AbstractCurve
from identification.surrogates.curves import MissingTorque, MissingVoltage

__all__ = ["with_curve"]


def with_curve(fit: Fit, along: str, carrier: str, equation: str) -> Fit:
    """Fit of the nominal model with a curve added."""
    (candidate,) = [
        c for kind in (MissingTorque, MissingVoltage) for c in kind.candidates(scales_of(fit))
        if isinstance(c.term, AbstractCurve)
        and (c.term.along, c.term.carrier, c.term.equation) == (along, carrier, equation)
    ]  # fmt: skip
    return refitted_with(fit, candidate.term, [Start(np.zeros(HEIGHTS))])
