"""Log posterior density of a fitted model, for many walkers at once.

The sampled dimensions are the search coordinates of the parameters, sheared along a curved ridge,
and the logarithms of the two noise deviations.  The initial states are integrated out: given the
parameters, the likelihood of an initial state is normal (exactly so for the nominal model), so that
the density is evaluated at its conditional optimum.  That optimum follows the parameters by the
normal equations and, along a ridge, as traced there.  A campaign of a hundred runs is thus sampled
in as few dimensions as one of two.

A fit on long records needs many substeps per sample interval, because the error of a coarse
simulation would shift the optimum.  Near the optimum that error is almost constant.  It is measured
there once and subtracted from the measured channels.  The coarse simulation then has the optimum of
the fine one and differs only by the change of its error across the posterior.

Source: Koziel and Leifsson, Simulation-Driven Design by Knowledge-Based Response Correction
Techniques, Springer (2016), chapter 4 (response correction of a coarse model).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np

from identification.arrays import Array
from identification.fit.own_states import own_cost
from identification.fit.solve import Fit
from identification.linear import root
from identification.model.composite import MotorModel
from identification.model.simulate import Simulator
from identification.posterior.ridge import Ridge, ridge_of

__all__ = ["Posterior", "coarser"]

_TOLERANCES: Final = (np.inf, 1.0, 0.2)
"""Discretisation errors of one interval over the noise that are tried in turn."""
_PROBES: Final = 8
_LIKE: Final = 0.1
"""RMS error of a log density over its RMS drop from the optimum; spreads are then within 5 %."""


@dataclass(frozen=True)
class Posterior:
    """Log density of points (n_walker, n_dim), as called by emcee."""

    fit: Fit
    """Optimum around which the initial states are linearised."""
    fraction: float
    """Effective sample fraction; below one if the residuals are heavy-tailed, or are autocorrelated
    in a way that the noise model does not describe."""
    smooth: MotorModel | None = None
    """The model with smoother friction, by which a coarse simulation may replace that of the fit;
    None if the fit has no sharper one."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the sampled dimensions: parameters, then the noise deviations."""
        return (*self.fit.coordinates.names, "noise_current_A", "noise_speed_rad_s")

    @property
    def units(self) -> tuple[str, ...]:
        """Units of the physical values of `names`."""
        return (*(p.unit for p in self.fit.coordinates.parameters), "A", "rad/s")

    @property
    def centre(self) -> Array:
        """(n_dim,) optimum."""
        return np.append(self.fit.position, np.log(self.fit.weighting.deviation))

    @cached_property
    def ridge(self) -> Ridge:
        """Shear between sampled and search coordinates."""
        return ridge_of(self.fit, self.fraction)

    def covariance(self) -> Array:
        """(n_dim, n_dim) covariance of the normal approximation at the optimum."""
        n = self.fit.position.size
        covariance = np.zeros((n + 2, n + 2))
        covariance[:n, :n] = self.fit.equations.covariance(self.fraction)
        counts = np.maximum(self.fit.weighting.counts * self.fraction, 2.0)
        covariance[n:, n:] = np.diag(0.5 / counts)
        return covariance

    def normal_points(self, seed: int, count: int) -> Array:
        """Draws (n_draw, n_dim) from the normal (Laplace) approximation, mirrored at the bounds."""
        factor = root(self.covariance())
        normal = np.random.default_rng(seed).standard_normal((count, factor.shape[0]))
        return self.mirrored(self.centre + normal @ factor.T)

    def normal_draws(self, seed: int, count: int = 2000) -> dict[str, Array]:
        """Physical values by name, (n_draw,) each, of draws from the normal approximation."""
        values = self.physical(self.normal_points(seed, count))
        return {name: values[:, k] for k, name in enumerate(self.names)}

    def mirrored(self, points: Array) -> Array:
        """Points (n_point, n_dim), mirrored at the bounds if they are outside."""
        n = self.fit.position.size
        inner = self.fit.coordinates.mirrored(self.ridge.bent(points[:, :n].T))
        straight = self.ridge.straightened(inner).T
        return np.concatenate([straight, points[:, n:]], axis=1)

    def physical(self, points: Array) -> Array:
        """Physical values (..., n_dim) of points (..., n_dim)."""
        flat = points.reshape(-1, points.shape[-1]).T
        n = self.fit.position.size
        position = self.ridge.bent(flat[:n])
        values = np.concatenate([self.fit.coordinates.values(position), np.exp(flat[n:])])
        return values.T.reshape(points.shape)

    @cached_property
    def simulator(self) -> Simulator:
        """The cheapest simulator that preserves the density.

        The density is compared with that of the fit's simulator at a few draws from the normal
        approximation.
        """
        fit = self.fit
        factor = root(self.covariance())
        normal = np.random.default_rng(0).standard_normal((_PROBES, factor.shape[0]))
        points = self.mirrored(np.vstack([self.centre, self.centre + normal @ factor.T]))
        exact: Array | None = None
        deviation = fit.weighting.deviation
        for simulator in coarser(fit.simulator, fit.values, fit.states, deviation, self.smooth):
            exact = self._density(fit.simulator, points) if exact is None else exact
            inside = np.isfinite(exact)
            fall = exact[inside] - exact[0]
            error = self._density(simulator, points)[inside] - exact[inside]
            error = error - error[0]
            if np.sum(error**2) <= _LIKE**2 * np.sum(fall**2):
                return simulator
        return fit.simulator

    def work(self, walkers: int) -> float:
        """Operations of one density evaluation at `walkers` points."""
        return self.simulator.misfit_work(walkers, self.fit.weighting)

    def __call__(self, points: Array) -> Array:
        """Log posterior density of points (n_walker, n_dim), (n_walker,)."""
        return self._density(self.simulator, points)

    def _density(self, simulator: Simulator, points: Array) -> Array:
        fit = self.fit
        n = fit.position.size
        position, log_deviation = self.ridge.bent(points[:, :n].T), points[:, n:].T
        prior = fit.coordinates.log_prior(position)
        # Outside the bounds, the optimum is simulated in place of the point.
        inside = np.isfinite(prior)
        safe = np.where(inside, position, fit.position[:, None])
        moved = safe - fit.position[:, None]
        states = [
            start[:, None] + fit.equations.state_response(k) @ moved + shift
            for k, (start, shift) in enumerate(
                zip(fit.states, self.ridge.state_shifts(safe), strict=True)
            )
        ]
        values = fit.coordinates.values(safe)
        sums = simulator.misfit(values, states, fit.weighting)
        counts = fit.weighting.counts[:, None]
        with np.errstate(over="ignore", invalid="ignore"):
            channels = counts * log_deviation + 0.5 * sums * np.exp(-2 * log_deviation)
            density = prior - self.fraction * np.sum(channels, axis=0)
            density = density - own_cost(simulator, states)
        return np.where(inside & np.isfinite(density), density, -np.inf)


def coarser(
    fine: Simulator,
    values: Array,
    states: Sequence[Array],
    deviation: Array,
    smooth: MotorModel | None = None,
) -> Iterator[Simulator]:
    """Simulators that cost less than `fine` and have its residuals at `values`, cheapest first.

    The values at the optimum are (n_parameter,) physical, the states (n_state,) for each record at
    its first sample, the noise of current and speed is (2,) [A, rad/s].  `smooth` is the model with
    smoother friction, which needs fewer substeps; None for the same.
    """
    if fine.substeps is None:
        return
    right = fine.logged(values[:, None], states)
    for tolerance in _TOLERANCES:
        coarse = replace(fine, substeps=None)
        if smooth is not None:
            coarse = coarse.changed_to(smooth, values)
        if np.isfinite(tolerance):
            coarse = coarse.with_tolerance(values, states, tolerance * deviation)
        if coarse.steps > 0.8 * fine.steps:
            return
        records = tuple(
            replace(record, measured=record.measured - (a - b)[:, :, 0])
            for record, a, b in zip(
                fine.records, right, coarse.logged(values[:, None], states), strict=True
            )
        )
        yield replace(coarse, records=records)
