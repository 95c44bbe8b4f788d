"""Run files for tests: a plausible record, written in every supported dialect."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.ingest import Run

Array = NDArray[np.float64]

ROWS = 4000

CANONICAL = ("time_s", "voltage_V", "current_A", "speed_rad_s", "temperature_degC")


def record(rows: int = 40, interval: float = 1e-3, seed: int = 1) -> dict[str, Array]:
    """Record that resembles a driven motor: all channels vary in both directions, with noise.

    Values have six decimals, so that written and read numbers can be compared.
    """
    noise = np.random.default_rng(seed)
    time = np.arange(rows) * interval
    voltage = np.where(np.arange(rows) // 10 % 2 == 0, 12.0, -12.0) + noise.normal(0.0, 0.05, rows)
    speed = np.cumsum(voltage) * 0.5 + noise.normal(0.0, 0.1, rows)
    current = voltage / 10.0 - speed / 100.0 + noise.normal(0.0, 0.01, rows)
    temperature = 25.0 + np.linspace(0.0, 2.0, rows) + noise.normal(0.0, 0.01, rows)
    values = (time, voltage, current, speed, temperature)
    return {name: np.round(column, 6) for name, column in zip(CANONICAL, values, strict=True)}


@dataclass(frozen=True)
class Dialect:
    """Format of a table."""

    delimiter: str = ","
    decimal: str = "."
    newline: str = "\n"
    encoding: str = "utf-8"
    quote: str = ""
    trailing: bool = False
    above: tuple[str, ...] = ()
    blank_lines_below: int = 0
    final_newline: bool = True


def cell(value: float, decimal: str = ".") -> str:
    """Shortest text that represents the number exactly."""
    return repr(float(value)).replace(".", decimal)


def write(
    columns: Mapping[str, Sequence[float] | Array],
    dialect: Dialect = Dialect(),
    units: Sequence[str] | None = None,
) -> bytes:
    """Write columns under their headers as the bytes of a file."""
    body = zip(*(np.asarray(column).tolist() for column in columns.values()), strict=True)
    rows: list[list[str]] = [list(columns)]
    if units is not None:
        rows.append(list(units))
    rows += [[cell(value, dialect.decimal) for value in row] for row in body]
    end = dialect.delimiter if dialect.trailing else ""
    lines = [
        dialect.delimiter.join(f"{dialect.quote}{text}{dialect.quote}" for text in row) + end
        for row in rows
    ]
    lines = [*dialect.above, *lines, *([""] * dialect.blank_lines_below)]
    text = dialect.newline.join(lines) + (dialect.newline if dialect.final_newline else "")
    return text.encode(dialect.encoding)


def with_cell(channel: str, sample: int, text: str, rows: int = 40) -> bytes:
    """Canonical file with one cell replaced; sample 0 is on line 2."""
    lines = write(record(rows)).decode().split("\n")
    cells = lines[sample + 1].split(",")
    cells[CANONICAL.index(channel)] = text
    lines[sample + 1] = ",".join(cells)
    return "\n".join(lines).encode()


def with_line(line: int, text: str | None, rows: int = 40) -> bytes:
    """Canonical file with one line, counted from 1, replaced, or removed where None."""
    lines = write(record(rows)).decode().split("\n")
    lines[line - 1 : line] = [] if text is None else [text]
    return "\n".join(lines).encode()


def renamed(**headers: str) -> bytes:
    """Canonical file with other header texts."""
    return write({headers.get(name, name): values for name, values in record().items()})


def changed(rows: int = 40, **values: Array | float) -> bytes:
    """Canonical file with other values in some channels."""
    columns = record(rows)
    for name, value in values.items():
        columns[name] = np.broadcast_to(np.asarray(value, dtype=np.float64), rows).copy()
    return write(columns)


def channels(run: Run) -> dict[str, Array]:
    """Channels that a run has, by canonical name."""
    every = (run.time, run.voltage, run.current, run.speed, run.temperature, run.position)
    names = (*CANONICAL, "position_rad")
    return {name: values for name, values in zip(names, every, strict=True) if values is not None}


def motor(rows: int = ROWS, interval: float = 1e-3, seed: int = 7) -> dict[str, Array]:
    """Small motor under random reversing steps, integrated by Euler's method, with noise.

    0.6 ohm, 0.07 V s/rad, 2e-4 kg m^2, without electrical time constant.
    """
    random = np.random.default_rng(seed)
    time = np.arange(rows, dtype=np.float64) * interval
    voltage = np.repeat(random.uniform(-12.0, 12.0, rows // 100 + 1), 100)[:rows]
    speed = np.zeros(rows)
    for k in range(rows - 1):
        torque = 0.07 * (voltage[k] - 0.07 * speed[k]) / 0.6
        speed[k + 1] = speed[k] + interval * (torque - 1e-4 * speed[k]) / 2e-4
    current = (voltage - 0.07 * speed) / 0.6
    return {
        "time_s": time,
        "voltage_V": voltage + random.normal(0.0, 0.02, rows),
        "current_A": current + random.normal(0.0, 0.05, rows),
        "speed_rad_s": speed + random.normal(0.0, 0.3, rows),
        "temperature_degC": 40.0 + random.normal(0.0, 0.1, rows),
    }
