"""Exports of a fit to other programs, each made by a process of its own.

The process is `motorid export` on the outputs of the fit, so the service loads no simulation code,
and a compiler that hangs ends with the process.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from threading import BoundedSemaphore
from typing import Final

from app.errors import FieldRefused, Unavailable

__all__ = ["EXPORTS", "exported"]

EXPORTS: Final[Mapping[str, tuple[str, str, str]]] = {
    "python-control": (".py", "text/x-python", "Python (python-control)"),
    "matlab": (".m", "text/x-matlab", "MATLAB"),
    "simulink-m": (".m", "text/x-matlab", "Simulink"),
    "modelica": (".mo", "text/x-modelica", "Modelica"),
    "fmu": (".fmu", "application/zip", "FMU 2.0"),
    "fmu3": (".fmu", "application/zip", "FMU 3.0"),
    "c": (".c", "text/x-c", "C"),
    "csv": (".csv", "text/csv", "table (CSV)"),
}
"""Suffix and media type of each format, and its name for users."""

_LONGEST_S: Final = 120.0
_AT_ONCE: Final = BoundedSemaphore(2)
_PROGRAM: Final = "import sys; from app.cli import main; sys.exit(main(sys.argv[1:]))"


def exported(directory: Path, form: str, temperatures: Sequence[float]) -> bytes:
    """Content of a file in a format; without temperatures [degC], those of the result.

    Raises:
        FieldRefused: The format, a temperature or the result is not accepted.
        Unavailable: The export failed or took too long.
    """
    if form not in EXPORTS:
        raise FieldRefused(
            f"export format {form!r} is not known; expected {', '.join(EXPORTS)}", field="form"
        )
    with _AT_ONCE, tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "export"
        words = ["export", str(directory / "result.json"), "--to", form, "--out", str(out)]
        words += [word for each in temperatures for word in ("--temperature", repr(each))]
        try:
            ended = subprocess.run(
                [sys.executable, "-c", _PROGRAM, *words],
                capture_output=True, text=True, timeout=_LONGEST_S, check=False,
            )  # fmt: skip
        except (OSError, subprocess.TimeoutExpired) as error:
            raise Unavailable(
                f"the export to {form} did not end within {_LONGEST_S:g} s; try again later"
            ) from error
        if ended.returncode == 0:
            return out.read_bytes()
        said = (ended.stderr.strip().splitlines() or ["no message"])[-1].removeprefix("motorid: ")
        said = said.replace(f"{directory}/", "")
        if ended.returncode == 2:
            raise FieldRefused(said, field="temperature")
        raise Unavailable(f"the export to {form} failed ({said[:200]}); try again later")
