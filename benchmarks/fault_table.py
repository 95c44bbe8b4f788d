"""Typical faults of test benches, applied to the tables of a campaign.

Each fault is a function of the tables of all runs and a random generator.  It returns tables in
which either the second run or all runs are changed.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final, Literal

import numpy as np
import pandas as pd
from scipy.linalg import expm

from bench import make_campaign

__all__ = ["FAULTS", "Fault", "Tables"]

Tables = list[pd.DataFrame]
Scope = Literal["one", "all"]
Outcome = Literal["refuse", "suspect", "warn", "none"]

_RPM: Final = 60.0 / (2.0 * math.pi)
_ODD: Final = 1
_PAUSES: Final = 8
"""Pauses in a run in which the bridge is off; each lasts half as long as the drive before it."""
_SEGMENTS: Final = 14
"""Segments of the commutator of a tachogenerator."""
_RIPPLE: Final = 0.04


@dataclass(frozen=True)
class Fault:
    """One fault of a campaign.

    Args:
        name: Name in the table.
        scope: Whether the fault is in one run or in all.
        outcome: Minimum expected outcome: refusal, suspicion, or a remark of any stage; ``none`` if
            the search for effects explains the fault, so that no check may find it.
        make: Function that applies the fault to the tables.
        corrected: Whether a mapping can correct the fault.
    """

    name: str
    scope: Scope
    outcome: Outcome
    make: Callable[[Tables, np.random.Generator], Tables]
    corrected: bool = False


def _each(scope: Scope, change: Callable[[pd.DataFrame], pd.DataFrame]) -> Callable[..., Tables]:
    def make(tables: Tables, rng: np.random.Generator) -> Tables:
        return [
            change(table.copy()) if scope == "all" or k == _ODD else table
            for k, table in enumerate(tables)
        ]

    return make


def _scaled(column: str, factor: float) -> Callable[[pd.DataFrame], pd.DataFrame]:
    return lambda table: table.assign(**{column: table[column] * factor})


def _magnitude(column: str) -> Callable[[pd.DataFrame], pd.DataFrame]:
    return lambda table: table.assign(**{column: table[column].abs()})


def _exchanged(one: str, other: str) -> Callable[[pd.DataFrame], pd.DataFrame]:
    return lambda table: table.assign(**{one: table[other], other: table[one]})


def _copied(source: str, onto: str) -> Callable[[pd.DataFrame], pd.DataFrame]:
    return lambda table: table.assign(**{onto: table[source]})


def _dead(column: str) -> Callable[[pd.DataFrame], pd.DataFrame]:
    def change(table: pd.DataFrame) -> pd.DataFrame:
        size = 0.005 * float(table[column].abs().max())
        noise = np.random.default_rng(len(table)).normal(0.0, size, len(table))
        return table.assign(**{column: noise})

    return change


def _constant(column: str, value: float) -> Callable[[pd.DataFrame], pd.DataFrame]:
    return lambda table: table.assign(**{column: value})


def _stuck(column: str) -> Callable[[pd.DataFrame], pd.DataFrame]:
    def change(table: pd.DataFrame) -> pd.DataFrame:
        values = table[column].to_numpy(float).copy()
        start = values.size // 2 + int(np.argmax(np.abs(values[values.size // 2 :])) // 2)
        values[start:] = values[start]
        return table.assign(**{column: values})

    return change


def _stuck_temperature(table: pd.DataFrame) -> pd.DataFrame:
    """Constant temperature, 60 K below the mean of the motor or 60 K above."""
    mean = float(table["temperature_degC"].mean())
    return table.assign(temperature_degC=mean - 60.0 if mean > 40.0 else mean + 60.0)


def _jumping(table: pd.DataFrame) -> pd.DataFrame:
    values = table["temperature_degC"].to_numpy(float).copy()
    values[len(values) // 3 : len(values) // 3 + 40] += 55.0
    return table.assign(temperature_degC=values)


def _shifted(column: str, samples: int) -> Callable[[pd.DataFrame], pd.DataFrame]:
    return lambda table: table.assign(**{column: np.roll(table[column].to_numpy(float), samples)})


def _saturated(table: pd.DataFrame) -> pd.DataFrame:
    limit = 0.5 * float(table["current_A"].abs().max())
    return table.assign(current_A=table["current_A"].clip(-limit, limit))


def _motionless(table: pd.DataFrame) -> pd.DataFrame:
    noise = np.random.default_rng(len(table)).normal(size=(len(table), 3))
    sizes = [0.002 * float(table[c].abs().max()) for c in ("voltage_V", "current_A", "speed_rad_s")]
    return table.assign(
        voltage_V=noise[:, 0] * sizes[0],
        current_A=noise[:, 1] * sizes[1],
        speed_rad_s=noise[:, 2] * sizes[2],
    )


def _direction_unmapped(table: pd.DataFrame) -> pd.DataFrame:
    """The voltage as a magnitude, beside the pin of the direction.

    The second run switches between two voltages, whose magnitude is constant.
    """
    forward = (table["voltage_V"] > 0.0).astype(int)
    return table.assign(voltage_V=table["voltage_V"].abs(), dir=forward)


def _rippled(table: pd.DataFrame) -> pd.DataFrame:
    """Speed of a tachogenerator whose voltage ripples with the segments of its commutator."""
    speed = table["speed_rad_s"].to_numpy(float)
    angle = np.cumsum(speed) * float(np.median(np.diff(table["time_s"])))
    return table.assign(speed_rad_s=speed * (1.0 + _RIPPLE * np.sin(_SEGMENTS * angle)))


def _coasting(scope: Scope) -> Callable[[Tables, np.random.Generator], Tables]:
    """Runs whose bridge is off at a duty of 0: no current flows, and friction slows the motor."""

    def make(tables: Tables, rng: np.random.Generator) -> Tables:
        truth = make_campaign(int(tables[0].attrs["motor"]), (), rows=2).truth
        return [
            _coasted(table, truth, rng) if scope == "all" or k == _ODD else table
            for k, table in enumerate(tables)
        ]

    return make


def _coasted(table: pd.DataFrame, truth: dict[str, Any], rng: np.random.Generator) -> pd.DataFrame:
    values, rows = truth["parameters"], len(table)
    step = float(np.median(np.diff(table["time_s"])))
    heat = float(table["temperature_degC"].mean()) - 25.0
    resistance = values["Ra25"] * (1.0 + values["alpha_Ra"] * heat)
    constant = values["Kt25"] * (1.0 + values["alpha_Kt"] * heat)
    whole = np.zeros((3, 3))
    whole[0] = np.array([-resistance, -constant, 1.0]) / values["L"]
    whole[1] = np.array([constant, -values["b"], 0.0]) / values["J"]
    driven = expm(whole * step)[:2]
    slowed = math.exp(-values["b"] / values["J"] * step)
    off = (np.arange(rows) * 3 * _PAUSES // rows) % 3 == 2
    voltage = np.where(off, 0.0, table["voltage_V"])
    states = np.zeros((rows, 2))
    for k in range(1, rows):
        current, speed = states[k - 1]
        if off[k - 1]:
            states[k] = 0.0, slowed * speed
        else:
            states[k] = driven @ (current, speed, voltage[k - 1])
    states[off, 0] = 0.0
    noise = np.array([truth["noise"]["current_A"], truth["noise"]["speed_rad_s"]])
    logged = states + noise * rng.standard_normal(states.shape)
    return table.assign(voltage_V=voltage, current_A=logged[:, 0], speed_rad_s=logged[:, 1])


def _foreign(tables: Tables, rng: np.random.Generator) -> Tables:
    """Replace the second run by a run of another motor."""
    other = make_campaign(int(tables[0].attrs["motor"]) + 1, rows=len(tables[0]))
    return [other.runs[_ODD].frame if k == _ODD else table for k, table in enumerate(tables)]


def _twice(tables: Tables, rng: np.random.Generator) -> Tables:
    return [tables[0] if k == _ODD else table for k, table in enumerate(tables)]


def _joined(tables: Tables, rng: np.random.Generator) -> Tables:
    """Cut the second run from its largest speed to one far from it, and close the gap in time."""
    table = tables[_ODD]
    speed, half = table["speed_rad_s"].to_numpy(), len(table) // 2
    first = int(np.argmax(np.abs(speed[:half]))) + 1
    last = half + int(np.argmax(np.abs(speed[half : half + half // 2] - speed[first - 1])))
    parts = pd.concat([table[:first], table[last:]], ignore_index=True)
    parts["time_s"] = table["time_s"].to_numpy()[: len(parts)]
    return [parts if k == _ODD else other for k, other in enumerate(tables)]


def _pieces(tables: Tables, rng: np.random.Generator) -> Tables:
    """Put all training runs into one file, as 40 segments with gaps of at least 1 s."""
    parts, clock = [], 0.0
    for table in tables[:5]:
        step = float(np.median(np.diff(table["time_s"])))
        for rows in np.array_split(np.arange(len(table)), 8):
            part = table.iloc[rows].copy()
            part["time_s"] = part["time_s"] - part["time_s"].iloc[0] + clock
            clock = float(part["time_s"].iloc[-1]) + max(1.0, 20 * step)
            parts.append(part)
    return [pd.concat(parts, ignore_index=True), *tables[5:]]


def _both(
    name: str,
    change: Callable[[pd.DataFrame], pd.DataFrame],
    outcome: tuple[Outcome, Outcome] = ("refuse", "refuse"),
    corrected: bool = False,
) -> list[Fault]:
    scopes: Sequence[Scope] = ("one", "all")
    return [
        Fault(name, scope, expected, _each(scope, change), corrected)
        for scope, expected in zip(scopes, outcome, strict=True)
    ]


def _one(
    name: str,
    change: Callable[[pd.DataFrame], pd.DataFrame],
    outcome: Outcome = "refuse",
    corrected: bool = False,
) -> Fault:
    return Fault(name, "one", outcome, _each("one", change), corrected)


FAULTS: Final[tuple[Fault, ...]] = (
    *_both("current reversed", _scaled("current_A", -1.0), corrected=True),
    *_both("speed reversed", _scaled("speed_rad_s", -1.0), corrected=True),
    *_both("voltage reversed", _scaled("voltage_V", -1.0), corrected=True),
    *_both("speed unsigned", _magnitude("speed_rad_s")),
    *_both("current unsigned", _magnitude("current_A")),
    *_both("voltage unsigned", _magnitude("voltage_V"), ("suspect", "refuse")),
    *_both(
        "direction of the voltage not mapped",
        _direction_unmapped,
        ("suspect", "refuse"),
        corrected=True,
    ),
    Fault("coasting at duty 0", "one", "suspect", _coasting("one")),
    Fault("coasting at duty 0", "all", "suspect", _coasting("all")),
    *_both("speed sensor ripple", _rippled, ("none", "none")),
    *_both("rpm", _scaled("speed_rad_s", _RPM), ("refuse", "suspect"), corrected=True),
    *_both("mA", _scaled("current_A", 1e3), ("refuse", "suspect"), corrected=True),
    *_both("mV", _scaled("voltage_V", 1e3), ("refuse", "suspect"), corrected=True),
    *_both("voltage and speed swapped", _exchanged("voltage_V", "speed_rad_s"), corrected=True),
    *_both("current and voltage swapped", _exchanged("current_A", "voltage_V"), corrected=True),
    *_both("current and speed swapped", _exchanged("current_A", "speed_rad_s"), corrected=True),
    *_both("current is a copy of voltage", _copied("voltage_V", "current_A")),
    *_both("voltage is a copy of speed", _copied("speed_rad_s", "voltage_V")),
    *_both("current is noise only", _dead("current_A")),
    *_both("current constant", _constant("current_A", 0.0), ("refuse", "warn")),
    _one("current stuck in mid-run", _stuck("current_A")),
    *_both("speed is noise only", _dead("speed_rad_s")),
    *_both("speed constant", _constant("speed_rad_s", 0.0), ("refuse", "warn")),
    _one("speed stuck in mid-run", _stuck("speed_rad_s")),
    Fault("another motor", "one", "refuse", _foreign),
    *_both(
        "Fahrenheit",
        lambda t: t.assign(temperature_degC=1.8 * t["temperature_degC"] + 32.0),
        ("refuse", "suspect"),
        corrected=True,
    ),
    *_both("kelvin", lambda t: t.assign(temperature_degC=t["temperature_degC"] + 273.15)),
    _one("temperature stuck", _stuck_temperature, corrected=True),
    _one("temperature jumping", _jumping, corrected=True),
    *_both("ms as s", _scaled("time_s", 1e3), ("refuse", "suspect"), corrected=True),
    Fault("duplicate run", "one", "warn", _twice),
    _one("current shifted", _shifted("current_A", 150)),
    _one("speed shifted", _shifted("speed_rad_s", 400)),
    _one("truncated run", lambda t: t.iloc[: len(t) // 10], "warn"),
    *_both("no motion", _motionless, ("warn", "refuse")),
    Fault("40 segments in one file", "one", "warn", _pieces),
    Fault("two recordings joined", "one", "suspect", _joined),
    _one("saturated current", _saturated, "warn"),
    _one("decimal separator lost", _scaled("current_A", 1e3), "refuse", corrected=True),
    _one("decimal separator lost in speed", _scaled("speed_rad_s", 1e3), "refuse", corrected=True),
)
"""All faults; each combination of name and scope is one row of the table."""
