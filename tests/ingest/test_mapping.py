"""Mapping of columns by the user: its meaning, and refusal of invalid entries."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from identification.errors import (
    AmbiguousUnit,
    DuplicateColumn,
    MappingError,
    NoHeader,
    RunFileError,
    UnknownUnit,
    WrongUnit,
)
from identification.ingest import read_mapping, read_run
from tests.ingest.samples import channels, record, renamed, write

NAMELESS = {f"CH{k}": column for k, column in enumerate(record().values())}


def nameless(tmp_path: Path) -> Path:
    """File with meaningless headers."""
    path = tmp_path / "run.csv"
    path.write_bytes(write(NAMELESS))
    return path


def mapping(**entries: object) -> dict[str, object]:
    """Mapping of the nameless file, with some entries changed."""
    names = ("time_s", "voltage_V", "current_A", "speed_rad_s", "temperature_degC")
    return {**{name: {"column": f"CH{k}"} for k, name in enumerate(names)}, **entries}


def test_mapping_alone_gives_every_channel_in_si(tmp_path: Path) -> None:
    """Without a unit in header and mapping, the column is in the SI unit of the channel."""
    run = channels(read_run(nameless(tmp_path), mapping=mapping()))

    for name, column in record().items():
        assert np.array_equal(run[name], column), name


def test_scale_and_offset_come_before_the_unit(tmp_path: Path) -> None:
    """Contract of a mapping: value = (cell * scale + offset) in the unit, here mA."""
    entry = {"column": "CH2", "scale": 200.0, "offset": -7.0, "unit": "mA"}

    run = read_run(nameless(tmp_path), mapping=mapping(current_A=entry))

    expected = (record()["current_A"] * 200.0 - 7.0) * 1e-3
    np.testing.assert_allclose(run.current, expected, rtol=1e-13)


def test_mapping_in_a_file_is_the_same_as_the_mapping_itself(tmp_path: Path) -> None:
    """The same entries as a dictionary and as JSON."""
    said = mapping(speed_rad_s={"column": "CH3", "unit": "rpm"})
    (tmp_path / "map.json").write_text(json.dumps(said), encoding="utf-8-sig")

    assert read_mapping(tmp_path / "map.json") == read_mapping(said)


def test_mapping_wins_over_another_column_of_the_right_name(tmp_path: Path) -> None:
    """Of two speed columns, the mapping selects the one without the canonical name."""
    path = tmp_path / "run.csv"
    columns = {**record(), "speed_filtered": record()["speed_rad_s"] * 2.0}
    path.write_bytes(write(columns))

    run = read_run(path, mapping={"speed_rad_s": {"column": "speed_filtered"}})

    assert np.array_equal(run.speed, columns["speed_filtered"])


@pytest.mark.parametrize("above", ["", "%  1  time\n%  2  3  battery, motor [V]\n", "# log 7\n"])
@pytest.mark.parametrize("delimiter", [" ", "; ", ", "])
def test_columns_without_a_header_are_mapped_by_number(
    tmp_path: Path, delimiter: str, above: str
) -> None:
    """Lines that a microcontroller prints, time in ms and speed in rpm, with the record behind."""
    wanted = record()
    columns = [wanted["time_s"] * 1e3, np.full(40, 12.0), *list(wanted.values())[1:4]]
    lines = [delimiter.join(map(repr, row)) for row in np.column_stack(columns).tolist()]
    path = tmp_path / "run.txt"
    path.write_text(above + "\n".join(lines) + "\n", encoding="utf-8")
    numbered = {
        "time_s": {"column": "column 1", "unit": "ms"},
        "voltage_V": {"column": "column 3"},
        "current_A": {"column": "column 4"},
        "speed_rad_s": {"column": "column 5", "unit": "rpm"},
    }

    run = read_run(path, mapping=numbered)

    assert run.rows == 40
    np.testing.assert_allclose(run.time, wanted["time_s"], rtol=1e-12)
    assert np.array_equal(run.voltage, wanted["voltage_V"])
    assert np.array_equal(run.current, wanted["current_A"])
    np.testing.assert_allclose(run.speed, wanted["speed_rad_s"] * np.pi / 30.0, rtol=1e-12)
    assert run.sources["voltage_V"].header == "column 3"
    del numbered["current_A"]
    with pytest.raises(NoHeader, match=r"no column for current_A: .* 5 columns, .*'column 5'"):
        read_run(path, mapping=numbered)


def test_unit_in_the_header_holds_for_a_mapped_column(tmp_path: Path) -> None:
    """A mapping without unit keeps the mA of the header."""
    path = tmp_path / "run.csv"
    path.write_bytes(renamed(current_A="2nd current [mA]"))

    run = read_run(path, mapping={"current_A": {"column": "2nd current [mA]"}})

    np.testing.assert_allclose(run.current, record()["current_A"] * 1e-3, rtol=1e-14)


def test_unit_that_contradicts_the_header_is_followed_with_a_warning(tmp_path: Path) -> None:
    """The unit of the mapping has priority, and a warning reports the conflict."""
    path = tmp_path / "run.csv"
    path.write_bytes(write(record()))
    said = {"speed_rad_s": {"column": "speed_rad_s", "unit": "rpm"}}

    run = read_run(path, mapping=said)

    np.testing.assert_allclose(run.speed, record()["speed_rad_s"] * 2 * np.pi / 60, rtol=1e-14)
    assert [w.code for w in run.warnings] == ["unit_overridden"]


def test_optional_channel_mapped_to_null_is_left_out(tmp_path: Path) -> None:
    """A position in ticks would be refused; null omits it, as the message suggests."""
    path = tmp_path / "run.csv"
    path.write_bytes(write({**record(), "position [ticks]": np.arange(40.0)}))

    run = read_run(path, mapping={"position_rad": None})

    assert run.position is None


def test_column_may_be_named_by_any_of_its_header_rows(tmp_path: Path) -> None:
    """Three header rows: long name, unit and short name of each column."""
    path = tmp_path / "run.csv"
    units = ("s", "V", "A", "rad/s", "degC")
    rows = [[f"Channel {k}" for k in range(5)], units, [f"c{k}" for k in range(5)]]
    above = tuple(",".join(row) for row in rows)
    body = write(record()).decode().split("\n", 1)[1]
    path.write_text("\n".join(above) + "\n" + body)
    said = {name: {"column": f"c{k}"} for k, name in enumerate(record())}

    run = channels(read_run(path, mapping=said))

    assert all(np.array_equal(run[name], column) for name, column in record().items())


@pytest.mark.parametrize(
    ("said", "error", "words"),
    [
        ({"speed": {"column": "CH3"}}, MappingError, "'speed' is no channel; expected time_s"),
        (mapping(current_A={"column": "CH2", "scael": 2}), MappingError, "key 'scael'; expected"),
        (
            mapping(current_A={"column": "CH9"}),
            MappingError,
            "there is no column 'CH9' for current_A, as the mapping gives; the file has 'CH0'",
        ),
        (
            mapping(current_A={"column": "CH9"}, speed_rad_s={"column": "n"}),
            MappingError,
            "no column 'CH9' for current_A, 'n' for speed_rad_s, as the mapping gives; the file",
        ),
        (mapping(current_A={"column": ""}), MappingError, "has no column"),
        (mapping(current_A={"column": 3}), MappingError, "has no column"),
        (mapping(current_A={}), MappingError, "has no column"),
        (mapping(current_A="CH2"), MappingError, 'expected {"column"'),
        (mapping(current_A=None), MappingError, "cannot be omitted"),
        (mapping(current_A={"column": "CH3"}), MappingError, "both map to the column 'CH3'"),
        (mapping(current_A={"column": "CH2", "scale": 0}), MappingError, "other than 0"),
        (mapping(current_A={"column": "CH2", "scale": 1e-320}), MappingError, "2.2e-308"),
        (mapping(current_A={"column": "CH2", "scale": -5e-324}), MappingError, "'-5e-324'"),
        (mapping(current_A={"column": "CH2", "offset": 1e-320}), MappingError, "'1e-320'"),
        (mapping(current_A={"column": "CH2", "scale": True}), MappingError, "the scale 'True'"),
        (
            mapping(current_A={"column": "CH2", "scale": "2"}),
            MappingError,
            r'the scale "2"; .* finite',
        ),
        (
            mapping(current_A={"column": "CH2", "offset": 1e308}),
            MappingError,
            r"the offset '1e\+308'; expected a finite number, below 1e\+300 in magnitude",
        ),
        ({"table": ""}, MappingError, 'table is ""; expected the name of a sheet'),
        (mapping(current_A={"column": "CH2", "scale": math.nan}), MappingError, "'nan'"),
        (mapping(current_A={"column": "CH2", "offset": math.inf}), MappingError, "'inf'"),
        (mapping(current_A={"column": "CH2", "scale": 10**5000}), MappingError, "huge integer"),
        (
            mapping(current_A={"column": "CH2", "unit": "dB"}),
            UnknownUnit,
            "'dB'; expected one of A",
        ),
        (mapping(current_A={"column": "CH2", "unit": 1}), UnknownUnit, "the unit '1'"),
        (mapping(current_A={"column": "CH2", "unit": "V"}), WrongUnit, "V of voltage"),
        ([], MappingError, "the mapping is not a JSON object"),
    ],
)
def test_mapping_at_fault_is_refused(
    tmp_path: Path, said: Any, error: type[RunFileError], words: str
) -> None:
    """The file is valid; each case changes one entry of the mapping."""
    with pytest.raises(RunFileError, match=words) as caught:
        read_run(nameless(tmp_path), mapping=said)

    assert type(caught.value) is error
    assert caught.value.file == "run.csv"
    assert str(caught.value).isprintable()


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "not JSON"),
        (b"{", "not JSON"),
        (b"[1, 2]", "the mapping is not a JSON object"),
        (b"\xff\xff", "not JSON"),
        (b"[" * 100_000, "not JSON"),
        (b'{"time_s": {"column": "a"}, "time_s": {"column": "b"}}', "'time_s' twice"),
        (b'{"time_s": {"column": "a", "column": "b"}}', "'column' twice"),
        (b'{"time_s": {"column": "a", "scale": ' + b"9" * 5000 + b"}}", "not JSON"),
        (b" " * 1_000_001, "more than 1000000 bytes"),
    ],
)
def test_mapping_file_at_fault_is_refused(tmp_path: Path, content: bytes, words: str) -> None:
    """Each case is invalid JSON, a duplicate key or a file that is too long."""
    path = tmp_path / "map.json"
    path.write_bytes(content)

    with pytest.raises(MappingError, match=words) as caught:
        read_mapping(path)

    assert caught.value.file == "map.json"


def test_mapping_file_that_is_not_there_is_refused(tmp_path: Path) -> None:
    """The file does not exist."""
    with pytest.raises(MappingError, match="cannot be opened"):
        read_mapping(tmp_path / "map.json")


def test_mapped_column_that_is_there_twice_is_refused(tmp_path: Path) -> None:
    """With two columns of one name, the mapping is ambiguous."""
    path = tmp_path / "run.csv"
    path.write_bytes(write(record()).replace(b"temperature_degC", b"current_A"))

    with pytest.raises(DuplicateColumn, match="columns 3, 5 have the same name"):
        read_run(path, mapping={"current_A": {"column": "current_A"}})


def test_scale_on_a_column_in_milliamperes_needs_a_unit(tmp_path: Path) -> None:
    """A scale of 0.001 may already convert to A; applying the unit as well would be a guess."""
    path = tmp_path / "run.csv"
    path.write_bytes(renamed(current_A="current_mA"))

    with pytest.raises(AmbiguousUnit, match='"unit": "mA"}} or .*"unit": "A"}}'):
        read_run(path, mapping={"current_A": {"column": "current_mA", "scale": 0.001}})


def test_scale_that_overflows_is_refused_at_its_cell(tmp_path: Path) -> None:
    """A scale of 9e299 makes any voltage impossible."""
    with pytest.raises(
        RunFileError, match="is impossible for a brushed motor|too large after scaling"
    ):
        read_run(nameless(tmp_path), mapping=mapping(voltage_V={"column": "CH1", "scale": 9e299}))


def test_entry_of_one_file_has_priority_over_the_shared_mapping(tmp_path: Path) -> None:
    """One run has a reversed current sensor; the others keep the shared mapping."""
    path = nameless(tmp_path)
    shared = mapping()
    single = {"run.csv": {"current_A": {"column": "CH2", "scale": -1.0}}}

    plain = read_run(path, mapping=shared)
    turned = read_run(path, mapping=shared | {"files": single})
    other = read_run(path, name="other.csv", mapping=shared | {"files": single})

    np.testing.assert_array_equal(turned.current, -plain.current)
    np.testing.assert_array_equal(other.current, plain.current)


@pytest.mark.parametrize("files", [3, {"run.csv": 3}, {"run.csv": {"curent_A": {"column": "I"}}}])
def test_a_mapping_of_files_is_checked_for_every_file(files: object) -> None:
    """Entries of files other than the present one are checked too."""
    with pytest.raises(MappingError):
        read_mapping({"files": files}, "another.csv")
