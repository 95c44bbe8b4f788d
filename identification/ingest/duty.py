"""Mean terminal voltage of a motor behind a chopper: duty cycle times bus voltage."""

from __future__ import annotations

import dataclasses

import numpy as np

from identification.arrays import Array
from identification.ingest.run import RunWarning, Source, SourceLocator

__all__ = ["voltage_source", "with_voltage"]


def with_voltage(
    values: dict[str, Array], locator: SourceLocator
) -> tuple[dict[str, Array], SourceLocator, RunWarning]:
    """Replace duty cycle and bus voltage by their product, the mean voltage of a switching period.

    Return the channels (n_sample,) in SI units, the locator of the voltage, and a warning that
    states the method.
    """
    kept = dict(values)
    duty, bus = kept.pop("duty"), kept.pop("bus_voltage_V")
    kept["voltage_V"] = duty * bus
    names = {name: locator.columns[name] for name in ("duty", "bus_voltage_V")}
    product = " x ".join(names.values())
    moved = dataclasses.replace(
        locator,
        columns={**locator.columns, "voltage_V": product},
        derived={**locator.derived, "voltage_V": "duty"},
    )
    note = (
        f"no motor voltage is logged: it is duty times bus voltage ({product}, "
        f"{np.min(duty):.4g} to {np.max(duty):.4g} times {np.min(bus):.4g} to {np.max(bus):.4g} V);"
        " dead time and voltage drops of the chopper are not subtracted, so they add to Ra25 and "
        "brush_drop"
    )
    return kept, moved, locator.warning("voltage_from_duty", note)


def voltage_source(duty: Source, bus: Source) -> Source:
    """Source of the product in V, for the result."""
    return Source(f"{duty.header} x {bus.header}", "V", method="duty")
