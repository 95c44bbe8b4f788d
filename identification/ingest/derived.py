"""Speed from a logged angle and voltage from a logged duty cycle, where they are not logged.

The mean terminal voltage of a motor behind a chopper is duty cycle times bus voltage.  The speed is
the difference quotient of the angle:

    w_k = (phi_k - phi_{k-1}) / (t_k - t_{k-1})                         [rad/s]

It is the mean over the interval that ends at sample k, which `speed_filter` calls the mean over the
sample interval.  The resolution of an encoder appears in it as noise of up to one count per
interval; nothing is smoothed.  The first sample of each record has no interval and is omitted.

An angle within one turn and a counter of a fixed width jump by their period.  The jumps are removed
if the period is known or unambiguous, and if no step exceeds `_LARGEST_STEP` of it: a motor that
turns faster could as well turn backwards.
"""

from __future__ import annotations

import dataclasses
import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from identification.arrays import Array
from identification.errors import AmbiguousAngle, of_file
from identification.ingest.channels import Channel
from identification.ingest.run import RunWarning, SourceLocator
from identification.ingest.timing import find_gaps

__all__ = ["CHOPPER_REMARK", "unwrapped", "with_speed", "with_voltage"]

_LARGEST_STEP = 0.4
_WIDTHS = (8, 16, 24, 32)
"""Usual widths of encoder counters [bit]."""


def unwrapped(cells: Array, time: Array, channel: Channel, locator: SourceLocator) -> Array:
    """Angle, counter or other channel (n_sample,), in the unit of the file, without its jumps.

    Raises:
        AmbiguousAngle: The period is not known, or the motor turns too fast for it.
    """
    steps = np.diff(cells)
    sound = np.ones(steps.size, dtype=bool)
    sound[find_gaps(time)] = False
    period = channel.period or _found_period(cells, steps, sound, channel, locator)
    if period is None:
        return cells
    span = float(np.ptp(cells))
    if span > period * (1.0 + 1e-9):
        raise locator.error(
            AmbiguousAngle,
            f"the values span {span:.6g}, more than the period {period:.6g} of the mapping; "
            "correct the period, which is in the unit of the cells, or omit it",
            channel.name,
            int(np.argmax(cells)),
            span,
        )
    turns = np.round(steps / period)
    left = np.where(sound, np.abs(steps - turns * period), 0.0)
    if np.max(left) > _LARGEST_STEP * period:
        sample = int(np.argmax(left)) + 1
        raise locator.error(
            AmbiguousAngle,
            f"changes by {left[sample - 1] / period:.3g} of its period {period:.6g} between two "
            f"samples, and above {_LARGEST_STEP:g} its direction is ambiguous; log faster, log the "
            "speed in place of an angle, or log a number that does not overflow",
            channel.name,
            sample,
            float(cells[sample]),
        )
    return cells - period * np.concatenate(([0.0], np.cumsum(turns)))


def _found_period(
    cells: Array, steps: Array, sound: NDArray[np.bool_], channel: Channel, locator: SourceLocator
) -> float | None:
    """Period of an angle that jumps: one turn, or the range of a counter."""
    size = np.where(sound, np.abs(steps), 0.0)
    at, span = int(np.argmax(size)), float(np.ptp(cells))
    turn = 2.0 * math.pi / abs(channel.scale * channel.unit.factor)
    is_count = bool(np.all(cells == np.round(cells)))
    periods = [turn, *(2.0**bits for bits in _WIDTHS if is_count)]
    fits = [p for p in periods if span <= p * (1.0 + 1e-9) and _explains(p, steps[sound])]
    if len(fits) == 1 or (fits and max(fits) <= min(fits) * (1.0 + 1e-3)):
        return fits[0]
    if not fits and size[at] <= max(0.5 * span, 0.5 * turn):
        return None
    entry = {"column": channel.column.label, "scale": channel.scale, "unit": channel.unit.name}
    periods_text = " or ".join(f"{p:.6g}" for p in fits) or "an unknown value"
    raise locator.error(
        AmbiguousAngle,
        f"the angle jumps from {cells[at]:.6g} to {cells[at + 1]:.6g}, so its period is "
        f"{periods_text}; expected a known period in the unit of the cells, such as 360 for "
        "degrees or 65536 for a counter of 16 bit; cut the run at the jump",
        channel.name,
        at + 1,
        float(cells[at + 1]),
        [of_file(locator.file, {channel.name: {**entry, "period": "PERIOD"}})],
    )


def _explains(period: float, steps: Array) -> bool:
    """True if there are jumps by a period, and the steps without them are like the others."""
    jumps = np.abs(steps) > 0.5 * period
    if not np.any(jumps):
        return False
    others = float(np.max(np.abs(steps[~jumps]), initial=0.0))
    left = np.abs(np.abs(steps[jumps]) - period)
    return bool(np.max(left) <= 2.0 * others + 1e-3 * period)


CHOPPER_REMARK: Final = (
    "dead time and voltage drops of the chopper are not subtracted, so they add to Ra25 and "
    "brush_drop; the current has to be that in the motor lead, because the supply current of a "
    "chopper is the duty times it"
)
"""Remark on the mean voltage of a switching period, and on the current that belongs to it."""


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
    product = f"{locator.columns['duty']} x {locator.columns['bus_voltage_V']}"
    moved = dataclasses.replace(
        locator,
        columns={**locator.columns, "voltage_V": product},
        derived={**locator.derived, "voltage_V": "duty"},
    )
    note = (
        f"no motor voltage is logged: it is duty times bus voltage ({product}, "
        f"{np.min(duty):.4g} to {np.max(duty):.4g} times {np.min(bus):.4g} to {np.max(bus):.4g} V);"
        f" {CHOPPER_REMARK}"
    )
    return kept, moved, locator.warning("voltage_from_duty", note)


def with_speed(
    values: dict[str, Array], channel: Channel, locator: SourceLocator
) -> tuple[dict[str, Array], SourceLocator, RunWarning]:
    """Add the difference quotient of the angle over each interval that is not a gap.

    The values are (n_sample,) in SI units, those of the angle without jumps.  Return the channels
    at the samples that end an interval, the locator of these samples, and a warning that states the
    method.
    """
    time, angle = values["time_s"], values["position_rad"]
    sound = np.ones(time.size - 1, dtype=bool)
    sound[find_gaps(time)] = False
    kept = np.flatnonzero(sound) + 1
    interval, steps = np.diff(time)[sound], np.diff(angle)[sound]
    note = (
        "no speed is logged: it is the difference of the angle over each sample interval, thus the "
        "mean over the interval that ends at the sample (a law of the effect speed_filter); "
        f"{time.size - kept.size} sample(s) that end no interval are omitted"
    )
    if np.any(steps):
        finest = float(np.min(np.abs(steps[steps != 0.0])) / np.median(interval))
        note += f"; the smallest change of the angle is a speed of {finest:.3g} rad/s"
    found = {name: signal[kept] for name, signal in values.items()}
    found["speed_rad_s"] = steps / interval
    moved = SourceLocator(
        locator.file,
        {**locator.columns, "speed_rad_s": channel.column.label},
        lambda sample: locator.row(int(kept[sample])),
        {**locator.derived, "speed_rad_s": channel.name},
    )
    return found, moved, locator.warning("speed_from_angle", note, channel.name)
