"""Sensitivities of the logged channels at one point of a fit, and their weighted products."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from identification.arrays import Array
from identification.model.simulate import Simulator
from identification.model.tangent import TangentBlock, tangent, tangent_blocks
from identification.model.weighting import Weighting
from identification.work import TOUCH, charge

__all__ = ["Derivatives", "gradient_of", "products"]

_PASSES: Final = 4.0
"""Number of times that a product reads or writes each sensitivity."""


@dataclass(frozen=True)
class Derivatives:
    """Sensitivities of the logged channels at one point, cached or recomputed on demand."""

    simulator: Simulator
    values: Array
    """(n_parameter,) physical values."""
    states: tuple[Array, ...]
    """For each record (n_state,) initial state."""
    directions: Array
    """(n_parameter, n_parameter) physical direction of each search coordinate."""
    kept: tuple[TangentBlock, ...] | None = None
    """Sensitivities of whole records; None if they are computed in blocks."""

    def blocks(self, lead: int) -> Iterator[TangentBlock]:
        """Iterate over the sensitivities, record by record or block by block.

        Each block of a record, except the first, repeats `lead` samples of the previous one.
        """
        if self.kept is not None:
            yield from self.kept
        else:
            yield from tangent_blocks(
                self.simulator, self.values, self.states, self.directions, lead
            )

    def keeping(self) -> Derivatives:
        """Copy with the sensitivities of whole records in memory."""
        if self.kept is not None:
            return self
        whole = tangent(self.simulator, self.values, self.states, self.directions)
        found = tuple(
            TangentBlock(k, 0, 0, *each) for k, each in enumerate(zip(*whole, strict=True))
        )
        return replace(self, kept=found)


def products(
    residual: Array, tangent: Array, weighting: Weighting, k: int, start: int = 0, lead: int = 0
) -> tuple[Array, Array]:
    """J'WJ and J'Wr of a record or of one block of it, in the order of the directions.

    The residual is (n_sample, 2) measured minus simulated [A, rad/s], the tangent (n_sample, 2,
    n_direction).  A block of record `k` begins at sample `start`; its `lead` first samples only
    start the whitening filter, since the previous block counts them.  The products are not finite
    if the model diverges.
    """
    size = tangent.shape[2]
    full, right = np.zeros((size, size)), np.zeros(size)
    weights = weighting.sample_weights(k)[start + lead : start + residual.shape[0]]
    charge(_PASSES * TOUCH * tangent.size)
    for channel in range(2):
        root = np.sqrt(weights[:, channel]) / weighting.deviation[channel]
        white = weighting.whitened(tangent[:, channel, :], channel)[lead:]
        jacobian = white * root[:, None]
        target = weighting.whitened(residual[:, channel], channel)[lead:] * root
        # A diverging model has sensitivities that overflow when squared; the caller sees infinity.
        with np.errstate(over="ignore", invalid="ignore"):
            full += jacobian.T @ jacobian
            right += jacobian.T @ target
    return full, right


def gradient_of(
    residual: Array, tangent: Array, weighting: Weighting, k: int, start: int = 0, lead: int = 0
) -> Array:
    """J'WR of a block, (n_direction, ...), of residuals (n_sample, 2, ...).

    The other arguments are those of `products`.
    """
    right = np.zeros((tangent.shape[2], *residual.shape[2:]))
    weights = weighting.sample_weights(k)[start + lead : start + residual.shape[0]]
    charge(_PASSES * TOUCH * (tangent.size + residual.size))
    for channel in range(2):
        scale = weights[:, channel] / weighting.deviation[channel] ** 2
        white = weighting.whitened(residual[:, channel], channel)[lead:]
        jacobian = weighting.whitened(tangent[:, channel, :], channel)[lead:]
        right += jacobian.T @ (white.T * scale).T
    return right
