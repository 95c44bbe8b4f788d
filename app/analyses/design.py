"""Request for the design of a run, from a body or from the query of a page."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from identification.design import DesignOptions

__all__ = ["Design", "DesignRequest"]


@dataclass(frozen=True)
class DesignRequest:
    """Options of a design, as `motorid design` takes them."""

    nameplate: str = ""
    """Nameplate of a motor without runs; empty for the design from a fit."""
    limits: str = ""
    """Limits, ``NAME=VALUE,...``; empty for those of the earlier runs."""
    duration: float | None = None
    """Duration [s]; None for that of the earlier runs."""
    rate: float | None = None
    """Sample rate [Hz]; None for that of the earlier runs."""
    temperatures: tuple[float, ...] = ()
    """Temperatures that the bench can hold [degC]."""
    narrow: str = ""
    """Quantity to narrow; empty for all parameters."""
    seed: int = 0
    """Seed."""

    @property
    def options(self) -> DesignOptions:
        """The options, validated.

        Raises:
            OptionError: An option is not accepted.
        """
        # Imported here: numpy would slow down every start.
        from identification.design import DesignOptions

        limits = (self.limits,) if self.limits else ()
        return DesignOptions(
            limits, self.duration, self.rate, self.temperatures, self.narrow, self.seed
        )

    def entry(self) -> dict[str, Any]:
        """The request as plain data."""
        return asdict(self)

    @classmethod
    def of(cls, entry: Mapping[str, Any]) -> DesignRequest:
        """The request of such data."""
        return cls(**{**entry, "temperatures": tuple(entry["temperatures"])})


@dataclass(frozen=True)
class Design:
    """Designed run."""

    entry: Mapping[str, Any]
    """Expected gain, as `motorid design` writes it to FILE.json."""
    table: str
    """Samples as CSV."""
