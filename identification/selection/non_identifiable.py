"""Non-identifiable directions between a spline curve and the other parameters of a model.

A line may be added to a curve without any change of the logged signals, if the nominal parameters
compensate for it:

    line in     equation      compensated by
    speed       mechanical    b
    current     mechanical    a common factor on J, b and the spline coefficients
    current     electrical    Ra25, with Ra25 alpha_Ra unchanged
    speed       electrical    a common factor on Kt25, J and b, with Kt25 alpha_Kt unchanged
    voltage     electrical    a common factor on Ra25, Kt25, L, J, b and the spline coefficients

The search and the sampler work with curves from which the line is removed.  The reported draws
include it: the slope is drawn from a prior, and the nominal parameters are changed so that the
simulated motor stays the same.  Their intervals then have the width that this direction requires,
and the parameters are not reported as identified.

The size of an effect can be collinear with the curve in the same way: a constant friction is a part
of every curve over the load, times the sign of the speed.  The shape of the curve is only that of a
spline, so data that separate the two by a few percent of their power separate them by its error.
The size is then a consider parameter with the curve that compensates for it.

The prior standard deviation of the line is four times the root mean square of the curve without
the line.  The factor is typical of powers of a signal: the line in i |i| is four times as large as
the rest, the line in i |i|^0.5 seven times, and the line in a step nearly twice.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import casadi as ca
import numpy as np

from identification.arrays import Array
from identification.effects.effect import effects_of
from identification.fit.solve import Fit
from identification.model.pointwise import values_at
from identification.selection.omitted import OmittedTerm
from identification.selection.policy import DEFAULT
from identification.selection.refit import refitted_as
from identification.surrogates.curve import HEIGHTS, REGRESSORS, AbstractCurve
from identification.surrogates.curves import is_formed, sampled

__all__ = [
    "LinearPart",
    "collinear_sizes",
    "linear_parts_of",
    "with_linear_parts",
    "with_linear_parts_drawn",
]

_LARGER: Final = 4.0
"""Prior standard deviation of a line over the root mean square of the rest of the curve."""
_MOST: Final = 0.5
"""Upper limit of that standard deviation, over the contribution of the nominal parameter."""
_ROUGH: Final = 1e-3
"""Penalty on second differences of the coefficients that compensate an effect, over their mean
square: it settles those with hardly any samples (P-spline of Eilers and Marx) [-]."""
_SAMPLES: Final = 500
_ALL: Final = 0.95
"""Upper limit of the line in any draw, over the contribution of the nominal parameter."""


@dataclass(frozen=True)
class LinearPart:
    """Linear part that belongs either to a curve or to a nominal parameter."""

    equation: str
    """``electrical`` or ``mechanical``."""
    signal: str
    """Signal to which it is proportional."""
    size: float
    """Scale of the signal, in its unit."""
    width: float
    """Prior standard deviation of the linear part at that scale [V] or [N m]."""
    unit: str
    """Unit of the linear part."""

    @property
    def name(self) -> str:
        """Name of its parameter."""
        return f"unlisted.linear_{self.signal}"

    def drawn(self, draws: dict[str, Array], rng: np.random.Generator) -> dict[str, Array]:
        """Draws with a random line in the curve and the nominal parameters that compensate it."""
        size = self.width * rng.standard_normal(draws["J"].shape) / self.size
        if (self.equation, self.signal) == ("mechanical", "speed"):
            # Reflected where the viscous friction would become negative.
            size = np.where(size > draws["b"], 2 * draws["b"] - size, size)
            return draws | {"b": draws["b"] - size, self.name: size * self.size}
        if self.equation == "mechanical" or self.signal == "speed":
            own = draws["Kt25"]
        else:
            own = draws["Ra25"] if self.signal == "current" else np.ones(size.shape)
        size = np.clip(size, -_ALL * own, _ALL * own)
        return draws | self._compensated(draws, 1.0 - size / own) | {self.name: size * self.size}

    def _compensated(self, draws: dict[str, Array], left: Array) -> dict[str, Array]:
        """Nominal parameters and spline coefficients that keep the response of the motor.

        `left` is what remains of the parameter from which the line is taken, as a fraction [-].
        """
        if (self.equation, self.signal) == ("electrical", "current"):
            return {"Ra25": draws["Ra25"] * left, "alpha_Ra": draws["alpha_Ra"] / left}
        scaled = {"J": draws["J"] * left, "b": draws["b"] * left}
        if (self.equation, self.signal) == ("electrical", "speed"):
            return scaled | {"Kt25": draws["Kt25"] * left, "alpha_Kt": draws["alpha_Kt"] / left}
        heights = {k: v * left for k, v in draws.items() if k.startswith("unlisted.height_")}
        if self.signal == "voltage":
            scaled |= {name: draws[name] * left for name in ("Ra25", "Kt25", "L")}
        return scaled | heights


def linear_parts_of(fit: Fit) -> tuple[LinearPart, ...]:
    """Free linear parts of the curves of a fit; see `with_linear_parts`."""
    found = []
    for term in fit.simulator.model.terms:
        if isinstance(term, AbstractCurve) and term.linear:
            sizes = (term.current, term.speed, term.size)
            found += [
                LinearPart(term.equation, name, size, width, term.unit)
                for name, size, width in zip(REGRESSORS, sizes, term.linear, strict=True)
                if width > 0.0
            ]
    return tuple(found)


def with_linear_parts_drawn(
    draws: dict[str, Array], lines: Sequence[LinearPart], seed: int
) -> dict[str, Array]:
    """Posterior draws, arrays of one shape by name, with non-identifiable lines added."""
    rng = np.random.default_rng([seed, len(lines)])
    for line in lines:
        draws = line.drawn(draws, rng)
    return draws


def with_linear_parts(fit: Fit) -> Fit:
    """The fit with the linear parts of its curves free; the optimum stays where it was."""
    for term in fit.simulator.model.terms:
        if isinstance(term, AbstractCurve) and not term.linear:
            linear = _widths(term, fit)
            if any(linear):
                fit = refitted_as(fit, replace(term, linear=linear))
    return fit


def _widths(term: AbstractCurve, fit: Fit) -> tuple[float, ...]:
    """Prior standard deviation of each linear part, zero if identifiable [N m] or [V]."""
    values = fit.by_name
    basis, regressors = sampled(replace(term, removed=()), fit.simulator.records)
    size = float(np.sqrt(np.mean((basis @ term.kept @ term.heights(values)) ** 2)))
    most = {
        ("electrical", "current"): values["Ra25"] * term.current,
        ("electrical", "speed"): values["Kt25"] * term.speed,
        ("mechanical", "current"): values["Kt25"] * term.current,
    }
    widths = []
    for name, regressor in zip(REGRESSORS, regressors.T, strict=True):
        width = 0.0
        if name in term.drivers and is_formed(basis, regressor):
            own = most.get((term.equation, name), term.size)
            width = min(_LARGER * size / float(np.sqrt(np.mean(regressor**2))), _MOST * own)
        widths.append(width)
    return tuple(widths)


def collinear_sizes(fit: Fit) -> tuple[OmittedTerm, ...]:
    """Sizes of effects that are collinear with a spline curve of the model, as consider parameters.

    A size is the amplitude or asymmetry of an effect; the fit has no free linear parts.
    """
    curves = [t for t in fit.simulator.model.terms if isinstance(t, AbstractCurve)]
    sizes = [
        f"{term.name}.{parameter.name}"
        for term in effects_of(fit.simulator.model.terms)
        for parameter in term.parameters
        if term.name != "unlisted" and parameter.vanishes
    ]
    if not curves or not sizes:
        return ()
    names, values = fit.coordinates.names, fit.by_name
    slopes = _slopes(fit, 0 if curves[0].equation == "electrical" else 1)
    heights = [f"unlisted.height_{k}" for k in range(1, HEIGHTS + 1)]
    basis = slopes[:, [names.index(name) for name in heights]]
    curve = basis @ np.array([values[name] for name in heights])
    stiffness = np.sqrt(_ROUGH * np.mean(np.sum(basis**2, axis=0)))
    penalised = np.vstack([basis, stiffness * np.diff(np.eye(HEIGHTS), n=2, axis=0)])
    zeros = np.zeros(HEIGHTS - 2)
    found = []
    for name in sizes:
        slope = slopes[:, names.index(name)]
        square = float(slope @ slope)
        if not (square > 0.0 and is_formed(basis, slope)):
            continue
        rest = curve - slope * float(slope @ curve) / square
        width = min(_LARGER * float(np.sqrt(rest @ rest / square)), _MOST * abs(values[name]))
        shares = np.linalg.lstsq(penalised, np.append(slope, zeros), rcond=None)[0]
        changes = {name: width} | dict(zip(heights, map(float, -width * shares), strict=True))
        scales = dict(zip(names, fit.coordinates.slopes(fit.position), strict=True))
        steps = {key: float(change / scales[key]) for key, change in changes.items()}
        found.append(OmittedTerm("unlisted", 0.0, DEFAULT.exclusion_loss, steps, name))
    return tuple(found)


def _slopes(fit: Fit, equation: int) -> Array:
    """(n_sample, n_parameter) derivative of di/dt or dw/dt with respect to each parameter."""
    model, values = fit.simulator.model, fit.values
    state, inputs, parameter = model.symbols()
    rate = model.rates(state, inputs, parameter)[equation]
    function = ca.Function(
        "slopes", [state, inputs, parameter], [ca.densify(ca.gradient(rate, parameter))]
    )
    trajectories = fit.simulator.states(values[:, None], fit.states)
    found = []
    for record, states in zip(fit.simulator.records, trajectories, strict=True):
        at = np.unique(np.linspace(0, record.rows - 2, _SAMPLES).astype(int))
        own = np.repeat(values[None], at.size, axis=0)
        found.append(values_at(function, states[at, :, 0], record.inputs[at], own))
    return np.concatenate(found)
