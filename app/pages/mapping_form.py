"""Mapping of columns to channels as a form: one line of fields for each channel."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Final

from app.errors import FieldRefused

__all__ = ["CHANNELS", "OPTIONAL", "mapping_from"]

CHANNELS: Final = {
    "time_s": "Time",
    "voltage_V": "Voltage",
    "current_A": "Current",
    "speed_rad_s": "Speed",
    "temperature_degC": "Temperature",
    "position_rad": "Shaft angle",
    "duty": "Duty cycle",
    "bus_voltage_V": "Bus voltage",
}
"""Channels with the names that the pages show."""

OPTIONAL: Final = ("temperature_degC", "position_rad", "duty", "bus_voltage_V")
"""Channels that a run may lack."""


def mapping_from(form: Mapping[str, str], earlier: Mapping[str, Any]) -> dict[str, Any] | None:
    """Mapping selected in a form, given the one before.

    The fields are `CHANNEL.column`, `.was` (the column before), `.unit`, `.sign`, `.factor` and
    `.offset`.

    The unit belongs to the column: if another column is selected, its header gives the unit.  A
    channel without a column is left to the header, unless the user has removed its column.

    Raises:
        FieldRefused: A factor or an offset is not a finite number.
    """
    mapping: dict[str, Any] = {}
    for channel in CHANNELS:
        column, was = (form.get(f"{channel}.{field}", "") for field in ("column", "was"))
        if not column:
            if channel in OPTIONAL and (was or earlier.get(channel, "") is None):
                mapping[channel] = None
            continue
        entry: dict[str, Any] = {"column": column}
        if column == was and form.get(f"{channel}.unit"):
            entry["unit"] = form[f"{channel}.unit"]
        scale = _number(form, f"{channel}.factor", 1.0)
        scale *= -1.0 if form.get(f"{channel}.sign") == "-" else 1.0
        offset = _number(form, f"{channel}.offset", 0.0)
        if (scale, offset) != (1.0, 0.0):
            entry |= {"scale": scale, "offset": offset}
        before = earlier.get(channel) or {}
        if column == was and "period" in before:
            entry["period"] = before["period"]
        mapping[channel] = entry
    return mapping or None


def _number(form: Mapping[str, str], field: str, default: float) -> float:
    text = form.get(field, "").strip()
    if not text:
        return default
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise FieldRefused(f"{field} is {text[:40]!r}; expected a number", field)
    return value
