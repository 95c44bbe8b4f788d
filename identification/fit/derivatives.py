"""Derivatives of what the records log at one point of a fit, kept or computed again."""

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
    """Derivatives of what the records log at one point, kept or computed again when asked for.

    Args:
        simulator: Model and records.
        values: (n_parameter,) physical.
        states: For each record (n_state,).
        directions: (n_parameter, n_parameter) physical, one a search coordinate.
        kept: The derivatives of whole records; None where they are computed in blocks.
    """

    simulator: Simulator
    values: Array
    states: tuple[Array, ...]
    directions: Array
    kept: tuple[TangentBlock, ...] | None = None

    def blocks(self, lead: int) -> Iterator[TangentBlock]:
        """The derivatives, record by record or block by block.

        Args:
            lead: Samples that each block but the first of a record has from the one before.
        """
        if self.kept is not None:
            yield from self.kept
        else:
            yield from tangent_blocks(
                self.simulator, self.values, self.states, self.directions, lead
            )

    def keeping(self) -> Derivatives:
        """These with the derivatives of whole records in memory."""
        if self.kept is not None:
            return self
        found = tangent_blocks(self.simulator, self.values, self.states, self.directions, rows=None)
        return replace(self, kept=tuple(found))
