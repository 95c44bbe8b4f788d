"""Run file writer in the canonical format."""

from __future__ import annotations

import csv
import os

from identification.ingest.run import Run

__all__ = ["write_run"]


def write_run(run: Run, path: str | os.PathLike[str]) -> None:
    """Write a run in canonical columns and SI units; the values read back bit for bit.

    Args:
        run: Run to write; segments, clipped samples and warnings are recomputed on reading.
        path: File to write.
    """
    columns = {
        "time_s": run.time,
        "voltage_V": run.voltage,
        "current_A": run.current,
        "speed_rad_s": run.speed,
        "temperature_degC": run.temperature,
        "position_rad": run.position,
    }
    present = {name: values.tolist() for name, values in columns.items() if values is not None}
    with open(path, "w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(present)
        # Python writes the shortest decimal that reads back as the same float.
        writer.writerows(zip(*present.values(), strict=True))
