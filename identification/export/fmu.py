"""Co-simulation FMU of the motor, FMI 2.0 or 3.0, around the C export.

The archive holds the sources, and the compiled library if this machine has a C compiler.

Source: Modelica Association, Functional Mock-up Interface, versions 2.0.4 and 3.0.1.
"""

from __future__ import annotations

import hashlib
import io
import platform
import shutil
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal
from uuid import UUID

from identification.export.c_code import TEMPLATES, c_code
from identification.export.model import Exported

__all__ = ["fmu"]

Fmi = Literal[2, 3]

_IDENTIFIER: Final = "motor"
_SOURCE: Final = "motor_fmu.c"
_DATE: Final = (1980, 1, 1, 0, 0, 0)
"""Date of all members, so that equal results give equal archives."""
_FLAGS: Final = ("-std=c99", "-O2", "-fPIC", "-shared")
_SECONDS: Final = 120

_EXCLUDED: Final = (
    "GetNumberOfVariableDependencies", "GetVariableDependencies", "SerializedFMUStateSize",
    "SerializeFMUState", "DeserializeFMUState", "GetDirectionalDerivative", "GetAdjointDerivative",
    "EnterConfigurationMode", "ExitConfigurationMode", "EnterEventMode", "GetIntervalDecimal",
    "GetIntervalFraction", "GetShiftDecimal", "GetShiftFraction", "SetIntervalDecimal",
    "SetIntervalFraction", "SetShiftDecimal", "SetShiftFraction", "EvaluateDiscreteStates",
    "UpdateDiscreteStates", "EnterContinuousTimeMode", "CompletedIntegratorStep", "SetTime",
    "SetContinuousStates", "GetContinuousStateDerivatives", "GetEventIndicators",
    "GetContinuousStates", "GetNominalsOfContinuousStates", "GetNumberOfEventIndicators",
    "GetNumberOfContinuousStates", "EnterStepMode", "GetOutputDerivatives",
    "ActivateModelPartition",
)  # fmt: skip
"""Functions of FMI 3.0 that the capabilities of the FMU exclude."""


@dataclass(frozen=True)
class _Variable:
    """One variable of the FMU; its value reference is its position in the list."""

    name: str
    causality: str
    variability: str
    initial: str
    start: float | None
    unit: str
    description: str


def fmu(motor: Exported, header: list[str], fmi: Fmi) -> tuple[bytes, tuple[str, ...]]:
    """Archive of the FMU for a major version of the standard, and remarks about what it lacks."""
    variables = list(_variables(motor))
    code = c_code(motor, header)
    token = str(UUID(hashlib.sha256(f"{fmi}{code}".encode()).hexdigest()[:32]))
    token = f"{{{token}}}" if fmi == 2 else token
    is_sampled = motor.model.has_history
    source = code + "\n" + TEMPLATES.get_template("fmu.c").render(
        fmi=fmi, token=token, is_sampled=is_sampled, interval=motor.interval, excluded=_EXCLUDED
    )  # fmt: skip
    units = dict.fromkeys(v.unit for v in variables)
    description = TEMPLATES.get_template("fmu.xml").render(
        fmi=fmi, token=token, identifier=_IDENTIFIER,
        description=" ".join(header), variables=variables, units=units,
        source=_SOURCE, is_sampled=is_sampled, interval=motor.interval,
    )  # fmt: skip
    members = {"modelDescription.xml": description.encode(), f"sources/{_SOURCE}": source.encode()}
    if fmi == 3:
        build = TEMPLATES.get_template("fmu_build.xml")
        text = build.render(identifier=_IDENTIFIER, source=_SOURCE)
        members["sources/buildDescription.xml"] = text.encode()
    library, remark = _library(source)
    if library:
        members[f"binaries/{_platform(fmi)}/{_IDENTIFIER}{_suffix()}"] = library
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in members.items():
            archive.writestr(zipfile.ZipInfo(name, _DATE), data, zipfile.ZIP_DEFLATED)
    return content.getvalue(), (remark,) if remark else ()


def _variables(motor: Exported) -> Iterator[_Variable]:
    """All variables in the order of their value references, which templates/fmu.c lists."""
    yield _Variable("time", "independent", "continuous", "", None, "s", "Time")
    for name, start, unit, text in (
        ("voltage", 0.0, "V", "Terminal voltage"),
        ("temperature", 25.0, "degC", "Temperature of winding and magnet, as the bench logged it"),
        ("load_torque", 0.0, "N m", "Load torque, positive against positive speed"),
        ("position", 0.0, "rad", "Shaft angle, used if position_given is 1"),
        ("voltage_rate", 0.0, "V/s", "Slope of the voltage within a communication step"),
        ("temperature_rate", 0.0, "K/s", "Slope of the temperature"),
        ("position_rate", 0.0, "rad/s", "Slope of the shaft angle within a communication step"),
    ):
        yield _Variable(name, "input", "continuous", "", start, unit, text)
    given = "1 if the input position is used, 0 for the simulated angle"
    yield _Variable("position_given", "parameter", "fixed", "exact", 0.0, "1", given)
    highest = "Highest temperature that the motor has had before the simulation"
    yield _Variable("peak_temperature", "parameter", "fixed", "exact", motor.peak, "degC", highest)
    for name, unit, text in (
        ("current", "A", "Current, as the sensor of the bench would log it"),
        ("speed", "rad/s", "Speed, as the sensor of the bench would log it"),
        ("angle", "rad", "Shaft angle"),
    ):
        yield _Variable(name, "output", "continuous", "calculated", None, unit, text)
    for name, signal, unit in zip(motor.model.state_names, motor.starts, motor.units, strict=True):
        start = 25.0 if signal == "temperature" else 0.0
        text = f"State; follows the {signal} unless it is set" if "." in name else "State"
        yield _Variable(f"state.{name}", "local", "continuous", "exact", start, unit, text)
    for parameter, value in motor.parameters:
        yield _Variable(
            parameter.name, "parameter", "tunable", "exact", value, parameter.unit,
            parameter.meaning,
        )  # fmt: skip


def _library(source: str) -> tuple[bytes, str]:
    """Compiled library, and a remark if there is none."""
    compiler = shutil.which("cc")
    if compiler is None or sys.platform == "win32":
        return b"", (
            "this machine has no C compiler 'cc', so the FMU holds only sources; install one and "
            "repeat the export, or compile the sources with the simulation program"
        )
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / _SOURCE
        path.write_text(source, encoding="utf-8")
        built = path.with_suffix(_suffix())
        words: list[str | Path] = [compiler, *_FLAGS, "-o", built, path, "-lm"]
        try:
            subprocess.run(words, check=True, capture_output=True, timeout=_SECONDS)
        except (OSError, subprocess.SubprocessError) as error:
            return b"", (
                f"the C compiler {compiler} failed ({str(error)[:100]}), so the FMU holds only "
                "sources"
            )
        return built.read_bytes(), ""


def _suffix() -> str:
    return ".dylib" if sys.platform == "darwin" else ".so"


def _platform(fmi: Fmi) -> str:
    """Folder of the library in the archive."""
    found = platform.machine().lower()
    machine = {"amd64": "x86_64", "arm64": "aarch64"}.get(found, found)
    system = "darwin" if sys.platform == "darwin" else "linux"
    return f"{system}64" if fmi == 2 and machine == "x86_64" else f"{machine}-{system}"
