"""Time and memory of fits of short records: many motors, each fitted in its own process.

    python -m benchmarks.short_runs [--motors 38] [--rows 370]

Each motor is drawn at random, with one run that contains dry friction, and is identified by the
complete command: reading, search, posterior, report.  The cache of compiled loops is empty at the
start, so the time of the first motor includes the compilation.  Python keeps the bytecode of the
modules, as after any installation.
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from bench import MOTORS, make_campaign

__all__ = ["main"]


def main(arguments: Sequence[str] | None = None) -> None:
    """Fit the motors, and print elapsed time, processor time and memory."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--motors", type=int, default=38)
    parser.add_argument("--rows", type=int, default=370, help="samples per run")
    options = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        files = [_written(number, options.rows, folder) for number in range(options.motors)]
        spent = [_fitted(file, folder) for file in files]
    walls, processors = np.array(spent).T
    memory = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024
    print(
        f"{options.motors} motors of {options.rows} samples: {walls.sum():.0f} s; the first "
        f"{walls[0]:.1f} s ({processors[0]:.1f} s of processors), the others in the median "
        f"{np.median(walls[1:]):.1f} s ({np.median(processors[1:]):.1f} s); at most "
        f"{memory:.0f} MB"
    )


def _written(number: int, rows: int, folder: Path) -> Path:
    """Write one run of a motor to a file."""
    motor = sorted(MOTORS)[number % len(MOTORS)]
    size = float(np.random.default_rng(number).uniform(0.01, 0.05))
    measured = make_campaign(
        motor, [("coulomb_friction", size)], seed=number, rows=rows, training=1, validation=1
    )
    path = folder / f"motor_{number}.csv"
    measured.training[0].frame.to_csv(path, index=False, float_format="%.9g")
    return path


def _fitted(file: Path, folder: Path) -> tuple[float, float]:
    """Elapsed time and processor time of one command [s]."""
    program = "from app.cli import main; main()"
    command = [sys.executable, "-c", program, "fit", str(file), "--out", str(folder / file.stem)]
    kept = {name: x for name, x in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    before, began = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    subprocess.run(
        command,
        check=True,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        env=kept | {"MOTORID_CACHE": str(folder / "loops")},
    )
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    used = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return time.perf_counter() - began, used


if __name__ == "__main__":
    main()
