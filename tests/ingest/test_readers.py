"""Readers of further formats: the one of docs/write-a-reader.md, and the checks common to all."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from identification import errors
from identification.ingest import ArrayTable, Limits, Reader, RunFile, describe_column, read_run
from tests.ingest.json_lines import JsonLinesReader
from tests.ingest.samples import CANONICAL, channels, record, write

Array = NDArray[np.float64]

ROOT = Path(__file__).parents[2]
JSON_LINES: Reader = JsonLinesReader()
NAMES = ("t", "u", "i", "n", "temp")
UNITS = ("ms", "V", "mA", "rpm", "degC")
FACTORS = (1e-3, 1.0, 1e-3, 2.0 * np.pi / 60.0, 1.0)


def json_lines(*, units: tuple[str, ...] = UNITS) -> list[str]:
    """The record in other units, one JSON text for each line."""
    columns = [values / f for values, f in zip(record().values(), FACTORS, strict=True)]
    header = json.dumps({"columns": NAMES, "units": units})
    return [header, *(json.dumps(row) for row in np.column_stack(columns).tolist())]


@dataclass(frozen=True)
class ArrayReader:
    """Reader that ignores the file and returns the record, with changes."""

    changes: Mapping[str, ArrayLike] = field(default_factory=dict)

    def recognises(self, name: str, head: bytes) -> bool:
        """Recognise the file of these tests."""
        return head == b"arrays"

    def open(self, file: RunFile) -> ArrayTable:
        """Return the arrays; the first sample is on row 3."""
        cells: dict[str, ArrayLike] = {**record(), **self.changes}
        columns = [describe_column(k, [name]) for k, name in enumerate(cells)]
        return ArrayTable(columns, list(cells.values()), first_row=3)


def test_page_shows_the_reader_that_these_tests_run() -> None:
    """The code block of the page is the file, byte for byte."""
    page = (ROOT / "docs" / "write-a-reader.md").read_text(encoding="utf-8")
    code = (ROOT / "tests" / "ingest" / "json_lines.py").read_text(encoding="utf-8")

    assert f"```python\n{code}```\n" in page


def test_json_lines_are_read_in_si_units(tmp_path: Path) -> None:
    """The expected values are the record's, before its conversion to the units of the file."""
    path = tmp_path / "run.jsonl"
    path.write_text("\n".join(json_lines()) + "\n")

    run = read_run(path, readers=[JSON_LINES])

    for name, values in channels(run).items():
        np.testing.assert_allclose(values, record()[name], rtol=1e-12, atol=1e-15)
    assert [(s.header, s.unit) for s in run.sources.values()] == [*zip(NAMES, UNITS, strict=True)]
    assert run.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()


def test_blank_temperatures_of_json_lines_are_interpolated(tmp_path: Path) -> None:
    """The third sample, on row 4, has no temperature; the warning gives this row."""
    lines = json_lines()
    lines[3] = json.dumps([*json.loads(lines[3])[:-1], None])
    path = tmp_path / "run.jsonl"
    path.write_text("\n".join(lines))

    run = read_run(path, readers=[JSON_LINES])

    assert [(w.code, w.row) for w in run.warnings] == [("interpolated_temperature", 4)]


@pytest.mark.parametrize(
    ("line", "text", "error", "words"),
    [
        (1, '{"columns": ["t"], "units": []}', errors.NoTable, "row 1: .*one unit for each"),
        (3, "[1, 2", errors.NoTable, "row 3: the line is not JSON"),
        (3, "[1, 2]", errors.RaggedRow, "row 3: expected an array of 5 cells"),
        (3, '[1, 2, 3, "x", 5]', errors.NotANumber, "row 3: 'x' is not a number"),
        (3, "[1, 2, null, 4, 5]", errors.MissingValue, "row 3, column i: the cell is blank"),
        (3, "[1, 2, 3, 1e999, 5]", errors.NotFinite, "row 3, column n: 'inf' is not a finite"),
        (3, "[0, 2, 3, 4, 5]", errors.RepeatedTime, "row 3, column t: the time 0 s is repeated"),
    ],
)
def test_faulty_json_lines_are_refused_with_their_row(
    tmp_path: Path, line: int, text: str, error: type[errors.RunFileError], words: str
) -> None:
    """One line of a valid file is replaced; the row is that of this line."""
    lines = json_lines()
    lines[line - 1] = text
    path = tmp_path / "run.jsonl"
    path.write_text("\n".join(lines))

    with pytest.raises(error, match=f"^run.jsonl, {words}"):
        read_run(path, readers=[JSON_LINES])


def test_unit_and_mapping_are_checked_for_every_format(tmp_path: Path) -> None:
    """The unit of the speed is wrong; a mapping gives the right one."""
    path = tmp_path / "run.jsonl"
    path.write_text("\n".join(json_lines(units=(*UNITS[:3], "knots", "degC"))))

    with pytest.raises(errors.UnknownUnit, match="the unit 'knots' is unknown"):
        read_run(path, readers=[JSON_LINES])
    run = read_run(
        path, readers=[JSON_LINES], mapping={"speed_rad_s": {"column": "n", "unit": "rpm"}}
    )

    np.testing.assert_allclose(run.speed, record()["speed_rad_s"], rtol=1e-12)


@pytest.mark.parametrize("name", ["run.csv", "run.jsonl"])
def test_file_of_another_format_goes_to_the_next_reader(tmp_path: Path, name: str) -> None:
    """A text table is read as such, whatever its ending."""
    path = tmp_path / name
    path.write_bytes(write(record()))

    run = read_run(path, readers=[JSON_LINES])

    assert np.array_equal(run.voltage, record()["voltage_V"])


@pytest.mark.parametrize(
    ("changes", "error", "words"),
    [
        ({"speed_rad_s": np.zeros(39)}, errors.RaggedRow, r"shapes \[\(39,\), \(40,\)\]"),
        ({"speed_rad_s": np.zeros((40, 1))}, errors.RaggedRow, r"shapes \[\(40,\), \(40, 1\)\]"),
        ({name: np.empty(0) for name in CANONICAL}, errors.TooFewRows, "0 samples are too few"),
        ({name: np.arange(9.0) for name in CANONICAL}, errors.TooFewRows, "row 11: 9 samples"),
        ({name: np.arange(99.0) for name in CANONICAL}, errors.FileTooLarge, "99 .* limit of 50"),
        ({"temperature_degC": np.full(40, -np.inf)}, errors.NotFinite, "row 3, .*'-inf' is not"),
    ],
)
def test_cells_of_every_reader_are_checked(
    tmp_path: Path, changes: dict[str, Array], error: type[errors.RunFileError], words: str
) -> None:
    """The record has 40 samples, the first on row 3; some of its columns are replaced."""
    path = tmp_path / "run"
    path.write_bytes(b"arrays")

    with pytest.raises(error, match=words) as caught:
        read_run(path, readers=[ArrayReader(changes)], limits=Limits(rows=50))

    assert caught.value.file == "run"


def test_integers_of_a_reader_become_floating_point_numbers(tmp_path: Path) -> None:
    """The position is an array of integers; all channels of a run are float64."""
    path = tmp_path / "run"
    path.write_bytes(b"arrays")

    run = read_run(path, readers=[ArrayReader({"position_rad": np.full(40, 3, dtype=np.int32)})])

    assert run.position is not None
    assert run.position.dtype == np.float64
    assert np.all(run.position == 3.0)


def test_digest_covers_bytes_that_a_reader_leaves_unread(tmp_path: Path) -> None:
    """The reader reads nothing; the expected digest is that of the file."""
    path = tmp_path / "run"
    path.write_bytes(b"arrays")

    run = read_run(path, readers=[ArrayReader()])

    assert run.sha256 == hashlib.sha256(b"arrays").hexdigest()
