"""Many motors, one after the other, from a manifest.

    motor,training,validation
    pump-17,pump17/run1.csv;pump17/run2.csv,pump17/check.csv

Each motor gets a directory of its own and a row in results.csv.  A motor whose result was made
from the same runs with the same options is not fitted again, so a batch that was interrupted is
taken up by giving the same command again.  One bad motor does not stop the others.
"""

from __future__ import annotations

import csv
import hashlib
import io
import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

from app import console
from app.commands import Show, identify_into, read_result
from app.outputs import writable_directory
from identification.errors import ComputationError, InputError, OptionError, UnreadableFile
from identification.options import FitOptions
from identification.quantities import DECLARED_PARAMETERS
from identification.report.atomic import write_text

__all__ = ["Motor", "read_manifest", "run_batch"]

_COLUMNS: Final = ("motor", "training", "validation")
# The motor's name becomes the name of a directory.
_NAME: Final = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.+-]{0,99}")
_RECORD: Final = "batch.json"


@dataclass(frozen=True)
class Motor:
    """One line of a manifest.

    Args:
        name: Name of the motor and of its directory.
        training: Run files to fit.
        validation: Run files to check on.
    """

    name: str
    training: tuple[Path, ...]
    validation: tuple[Path, ...] = ()


def run_batch(manifest: Path, out: Path, options: FitOptions, *, show: Show) -> None:
    """Fit every motor of a manifest.

    Args:
        manifest: The CSV file.
        out: Directory that gets a directory for each motor, and results.csv.
        options: Options of every fit.
        show: What goes to standard output.

    Raises:
        InputError: The manifest or the directory is at fault.
        ComputationError: Motors failed; the table says which and why.
    """
    motors = read_manifest(manifest)
    rows: list[dict[str, Any]] = []
    with writable_directory(out), console.progress_bar(show.quiet) as progress:
        for number, motor in enumerate(motors):

            def share(
                stage: str, done: float, number: int = number, name: str = motor.name
            ) -> None:
                progress(f"{name}: {stage}", (number + done) / len(motors))

            rows.append(_row(motor, *_fitted(motor, out / motor.name, options, share)))
            _write_table(out / "results.csv", rows)
    if show.as_json:
        console.print_json(rows)
    elif not show.quiet:
        console.print_rows(["motor", "status", *DECLARED_PARAMETERS], rows)
    failed = [row["motor"] for row in rows if row["status"] == "failed"]
    if failed:
        raise ComputationError(
            f"{len(failed)} of {len(motors)} motors failed ({', '.join(failed[:5])}"
            f"{', ...' if len(failed) > 5 else ''}); {out / 'results.csv'} says why"
        )


def read_manifest(path: Path) -> list[Motor]:
    """Motors of a manifest.

    Args:
        path: CSV file with the columns motor, training and, optionally, validation; paths are
            relative to the file and separated by semicolons.

    Raises:
        InputError: The file cannot be read, or a line is at fault.
    """
    try:
        lines = list(csv.reader(io.StringIO(path.read_text(encoding="utf-8-sig"))))
    except OSError as error:
        raise UnreadableFile(
            f"cannot be opened ({error.strerror}); expected a manifest", file=str(path)
        ) from error
    except (UnicodeDecodeError, csv.Error) as error:
        raise InputError(
            "is not a CSV file of text; expected a manifest", file=str(path)
        ) from error
    header = [cell.strip() for cell in lines[0]] if lines else []
    if header[:2] != ["motor", "training"] or header[2:] not in ([], ["validation"]):
        raise InputError(
            f"begins with {','.join(header)[:80]!r}; expected the columns {','.join(_COLUMNS)}",
            file=str(path),
            row=1,
        )
    motors: dict[str, Motor] = {}
    for row, cells in enumerate(lines[1:], start=2):
        if any(cell.strip() for cell in cells):
            motor = _motor(cells, path, row)
            if motor.name in motors:
                raise InputError(
                    f"motor {motor.name!r} is there twice; give each motor one line",
                    file=str(path),
                    row=row,
                )
            motors[motor.name] = motor
    if not motors:
        raise InputError("lists no motor; expected a line for each", file=str(path))
    return list(motors.values())


def _motor(cells: Sequence[str], path: Path, row: int) -> Motor:
    name = cells[0].strip()
    if not _NAME.fullmatch(name):
        raise InputError(
            f"{name[:60]!r} is no name of a motor; expected letters, digits and _ . + -",
            file=str(path),
            row=row,
            column="motor",
        )
    training, validation = (
        tuple(path.parent / file.strip() for file in cell.split(";") if file.strip())
        for cell in (*cells[1:3], "", "")[:2]
    )
    if not training or len(cells) > len(_COLUMNS):
        raise InputError(
            f"has {len(cells)} cells and {len(training)} training runs; expected motor, at least "
            "one training run, and validation runs",
            file=str(path),
            row=row,
        )
    return Motor(name, training, validation)


def _fitted(
    motor: Motor, out: Path, options: FitOptions, progress: console.Progress
) -> tuple[str, Mapping[str, Any], str]:
    """Status, result and message of one motor; a result that is still true is taken as it is."""
    try:
        record = _record(motor, options)
        made = out / _RECORD
        if made.exists() and made.read_text(encoding="utf-8") == record:
            return "kept", read_result(out / "result.json"), ""
        result = identify_into(out, motor.training, motor.validation, options, None, progress)
        # Written last: where it stands, the result is complete.
        write_text(made, record)
    except (InputError, ComputationError, OSError) as error:
        return "failed", {}, " ".join(str(error).split())
    return "fitted", result, ""


def _record(motor: Motor, options: FitOptions) -> str:
    """What a result depends on: the runs' bytes and the options."""
    try:
        runs = {
            role: [hashlib.sha256(file.read_bytes()).hexdigest() for file in files]
            for role, files in (("training", motor.training), ("validation", motor.validation))
        }
    except OSError as error:
        raise OptionError(f"{error.filename}: cannot be opened ({error.strerror})") from error
    return json.dumps({"runs": runs, "options": asdict(options)}, indent=2) + "\n"


def _row(motor: Motor, status: str, result: Mapping[str, Any], message: str) -> dict[str, Any]:
    medians = {
        name: (result.get("parameters", {}).get(name) or {}).get("median")
        for name in DECLARED_PARAMETERS
    }
    effects = " ".join(effect["name"] for effect in result.get("effects", ()))
    return {"motor": motor.name, "status": status, **medians, "effects": effects, "error": message}


def _write_table(path: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    table = io.StringIO()
    writer = csv.DictWriter(table, rows[0], lineterminator="\n")
    writer.writeheader()
    writer.writerows({name: _harmless(value) for name, value in row.items()} for row in rows)
    write_text(path, table.getvalue())


def _harmless(value: object) -> object:
    """A text that a spreadsheet would take for a formula gets a quotation mark in front."""
    return f"'{value}" if isinstance(value, str) and value[:1] in ("=", "+", "-", "@") else value
