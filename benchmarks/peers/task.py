"""One posterior for all samplers: data, priors, coordinates and initial states in one file.

A point has nine dimensions: the search coordinates of the seven parameters, and the logarithms of
the two noise deviations.  Initial states are integrated out as in the package: they follow the
parameters by a linear response, which is exact for the nominal model.  The peers receive optimum,
covariance and response at no cost.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

__all__ = ["NAMES", "Task"]

Array = NDArray[np.float64]

NAMES = ("Ra25", "alpha_Ra", "Kt25", "alpha_Kt", "J", "b", "L", "noise_current", "noise_speed")


@dataclass(frozen=True)
class Task:
    """Data and posterior.

    Args:
        interval: (1,) sample interval [s].
        voltage: (n_run, n_sample) [V].
        temperature: (n_run, n_sample) mean of each interval [degC].
        current: (n_run, n_sample) [A].
        speed: (n_run, n_sample) [rad/s].
        truth: (9,) true values in the order of `NAMES`.
        guess: (7,) rough starting values of a fit, 20 to 50 % wrong.
        is_log: (7,) 1 if the coordinate is the logarithm.
        scale: (7,) unit of a linear coordinate.
        prior_mean: (7,) centre of the normal prior of the coordinates.
        prior_sd: (7,) its standard deviation.
        lower: (7,) lower bounds of the coordinates.
        upper: (7,) upper bounds of the coordinates.
        counts: (2,) samples of current and speed.
        centre: (9,) optimum.
        root: (9, 9) Cholesky factor of the covariance of the normal approximation.
        states: (n_run, 2) initial current and speed at the optimum.
        response: (n_run, 2, 7) derivative of the initial states with respect to the coordinates.
        logged_temperature: (n_run, n_sample) temperature at the samples [degC].
        substeps: (1,) Runge-Kutta steps per interval that shift no estimate by more than half its
            standard deviation.
    """

    interval: Array
    voltage: Array
    temperature: Array
    current: Array
    speed: Array
    truth: Array
    guess: Array
    is_log: Array
    scale: Array
    prior_mean: Array
    prior_sd: Array
    lower: Array
    upper: Array
    counts: Array
    centre: Array
    root: Array
    states: Array
    response: Array
    logged_temperature: Array
    substeps: Array

    @classmethod
    def load(cls, path: Path) -> Task:
        """Read a task from a file."""
        with np.load(path) as stored:
            return cls(**{field.name: stored[field.name] for field in fields(cls)})

    def save(self, path: Path) -> None:
        """Write the task to a file."""
        np.savez(path, **{field.name: getattr(self, field.name) for field in fields(self)})

    def started(self, seed: int, count: int) -> Array:
        """(count, 9) draws from the normal approximation, from which every sampler starts."""
        normal = np.random.default_rng(seed).standard_normal((count, self.centre.size))
        return np.asarray(self.centre + normal @ self.root.T)

    def values(self, points: Array) -> Array:
        """(n_point, 7) physical values of points (n_point, 9)."""
        position = points[:, :7]
        logs = np.exp(np.where(self.is_log == 1, position, 0.0))
        return np.where(self.is_log == 1, logs, position * self.scale)

    def physical(self, points: Array) -> Array:
        """(..., 9) physical values in the order of `NAMES` of points (..., 9)."""
        flat = points.reshape(-1, points.shape[-1])
        values = np.concatenate([self.values(flat), np.exp(flat[:, 7:])], axis=1)
        return values.reshape(points.shape)

    def starts(self, points: Array) -> Array:
        """(n_point, n_run, 2) initial current and speed."""
        moved = points[:, :7] - self.centre[:7]
        return np.ascontiguousarray(self.states + np.einsum("rcp,np->nrc", self.response, moved))

    def log_density(self, points: Array, sums: Array) -> Array:
        """(n_point,) log posterior density.

        Args:
            points: (n_point, 9).
            sums: (n_point, 2) sums of squared residuals of current and speed.
        """
        position, deviation = points[:, :7], points[:, 7:]
        inside = np.all((position >= self.lower) & (position <= self.upper), axis=1)
        prior = -0.5 * np.sum(((position - self.prior_mean) / self.prior_sd) ** 2, axis=1)
        channels = self.counts * deviation + 0.5 * sums * np.exp(-2.0 * deviation)
        return np.where(inside, prior - channels.sum(axis=1), -np.inf)
