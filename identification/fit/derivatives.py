"""Sensitivities of the logged channels at one point of a fit, cached or recomputed."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from identification.model.simulate import Simulator
from identification.model.tangent import TangentBlock, tangent_blocks

__all__ = ["Derivatives"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Derivatives:
    """Sensitivities of the logged channels at one point, cached or recomputed on demand.

    Args:
        simulator: Model and records.
        values: (n_parameter,) physical values.
        states: For each record (n_state,) initial state.
        directions: (n_parameter, n_parameter) physical direction of each search coordinate.
        kept: Sensitivities of whole records; None if they are computed in blocks.
    """

    simulator: Simulator
    values: Array
    states: tuple[Array, ...]
    directions: Array
    kept: tuple[TangentBlock, ...] | None = None

    def blocks(self, lead: int) -> Iterator[TangentBlock]:
        """Iterate over the sensitivities, record by record or block by block.

        Args:
            lead: Samples that each block of a record, except the first, repeats from the previous
                block.
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
        found = tangent_blocks(self.simulator, self.values, self.states, self.directions, rows=None)
        return replace(self, kept=tuple(found))
