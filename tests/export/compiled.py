"""A C export as a shared library, driven by the inputs of a prediction."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.export.results import Inputs

__all__ = ["CompiledMotor", "compiled"]

INPUTS = (
    "voltage", "voltage_next", "temperature", "temperature_next", "temperature_rate", "angle",
    "angle_next", "angle_given", "load_torque",
)  # fmt: skip


def compiled(text: str, directory: Path) -> Path:
    """Shared library of a C file, compiled without warnings; skips without a compiler."""
    compiler = shutil.which("cc")
    if compiler is None:
        pytest.skip("no C compiler 'cc'")
    source = directory / "motor.c"
    source.write_text(text, encoding="utf-8")
    library = directory / "motor.so"
    strict = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-shared", "-fPIC"]
    subprocess.run([compiler, *strict, "-O1", source, "-o", library, "-lm"], check=True)
    return library


class CompiledMotor:
    """One motor in a compiled library.

    Args:
        library: The shared library.
        carry: Number of values in its carry.
        parameters: Number of its parameters.
    """

    def __init__(self, library: Path, carry: int, parameters: int) -> None:
        class Motor(ctypes.Structure):
            """Memory of the motor, as the C file declares it."""

            _fields_ = (
                ("carry", ctypes.c_double * carry),
                ("parameters", ctypes.c_double * parameters),
                ("time", ctypes.c_double),
                ("peak_temperature", ctypes.c_double),
                ("interval", ctypes.c_double),
                ("substeps", ctypes.c_int),
            )

        self._library = ctypes.CDLL(str(library))
        self.motor = Motor()
        self._library.motorid_init(ctypes.byref(self.motor))

    def start(self, current: float, speed: float, temperature: float) -> None:
        """Initialise the states from the readings of the first sample."""
        start = self._library.motorid_start
        start.argtypes = [ctypes.c_void_p, *[ctypes.c_double] * 3]
        start(ctypes.addressof(self.motor), current, speed, temperature)

    def run(
        self, inputs: Inputs, tolerance: float | None = None, **fixed: float
    ) -> NDArray[np.float64]:
        """Readings at each sample, (n_sample, 3), by fixed or by converged steps."""
        within = self._library.motorid_step_within
        within.argtypes = [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_double]
        size = inputs["voltage"].size
        out = np.empty((size, 3))
        columns = {**inputs, **{name: np.full(size, value) for name, value in fixed.items()}}
        rows = np.column_stack([columns.get(name, np.zeros(size)) for name in INPUTS])
        for k, row in enumerate(rows):
            given = (ctypes.c_double * len(INPUTS))(*row)
            readings = (ctypes.c_double * 3)()
            self._library.motorid_read(ctypes.byref(self.motor), given, readings)
            out[k] = readings[:]
            if tolerance is None:
                self._library.motorid_step(ctypes.byref(self.motor), given)
            else:
                within(ctypes.addressof(self.motor), ctypes.addressof(given), tolerance)
        return out
