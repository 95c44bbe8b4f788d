"""Cells that the mapping supplies: signs from a direction, constants, and times of rows."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from app.commands.arguments import mapping_of
from identification.checks import check_runs
from identification.errors import AbsurdValue, MappingError, MissingColumn, NotANumber, OptionError
from identification.ingest import read_run
from identification.ingest.supplied import DIRECTIONS, STOP
from identification.preview import check
from tests.ingest.samples import motor, record

RECORD = record(400)
SIGN = np.where(RECORD["voltage_V"] < 0.0, -1, 1)


def board(direction: object, **more: object) -> pd.DataFrame:
    """The record as a board logs it: the duty of 48 V as a magnitude, and a direction."""
    columns = {**RECORD, "pwm": np.abs(RECORD["voltage_V"]) / 48.0, "dir": direction, **more}
    del columns["voltage_V"]
    return pd.DataFrame(columns)


def mapped(*settings: str) -> Any:
    """The mapping of ``--map`` texts."""
    return mapping_of(None, settings)


def test_record_reverses() -> None:
    """Otherwise no sign would be tested."""
    assert {-1, 1} == set(SIGN.tolist())


@pytest.mark.parametrize(
    "direction",
    [
        SIGN,
        (SIGN > 0).astype(int),
        SIGN > 0,
        np.where(SIGN > 0, "CW", "CCW"),
        np.where(SIGN > 0, "fwd", "rev"),
        np.where(SIGN > 0, "1", "-1"),
        np.where(SIGN > 0, "True", "False"),
        np.where(SIGN > 0, "F", "R"),
        np.where(SIGN > 0, "R", "L"),
    ],
)
@pytest.mark.parametrize("is_file", [True, False])
def test_direction_gives_the_sign(tmp_path: Path, direction: object, is_file: bool) -> None:
    """The expected voltage is that of the record."""
    path = tmp_path / "run.csv"
    board(direction).to_csv(path, index=False)
    source = path if is_file else board(direction)

    run = read_run(source, mapping=mapped("voltage_V=pwm * dir * 48"))

    assert run.voltage == pytest.approx(RECORD["voltage_V"], rel=1e-12)
    assert run.sources["voltage_V"].entry()["sign"] == "dir"
    codes = {warning.code: warning.message for warning in run.warnings}
    assert f"negative in {np.count_nonzero(SIGN < 0)} of 400" in codes["sign_from_direction"]
    assert "unused_columns" not in codes


def test_zero_beside_minus_one_is_standstill() -> None:
    """A column of -1, 0 and 1 gives its product."""
    direction = SIGN.copy()
    direction[:7] = 0

    run = read_run(board(direction), mapping=mapped("voltage_V=pwm * dir * 48"))

    assert np.all(run.voltage[:7] == 0.0)
    assert run.voltage[7:] == pytest.approx(RECORD["voltage_V"][7:], rel=1e-12)


STOPPED = np.arange(400) % 40 < 6
"""Samples at which the board stops the motor."""


@pytest.mark.parametrize("word", ["stop", "STOP", "brake", "halt", "aus", " Off ", "N"])
@pytest.mark.parametrize("reverse", ["rev", "fwd"])
@pytest.mark.parametrize("is_file", [True, False])
def test_stop_among_the_directions_is_no_voltage(
    tmp_path: Path, word: str, reverse: str, is_file: bool
) -> None:
    """The duty stands at its last value; a motor that never reverses is not reversed by a stop."""
    sign = np.where(STOPPED, 0, SIGN if reverse == "rev" else 1)
    data = board(np.where(STOPPED, word, np.where(SIGN > 0, "fwd", reverse)))
    data.to_csv(tmp_path / "run.csv", index=False)

    run = read_run(
        tmp_path / "run.csv" if is_file else data, mapping=mapped("voltage_V=pwm * dir * 48")
    )

    expected = sign * np.abs(RECORD["voltage_V"])
    assert run.voltage == pytest.approx(expected, rel=1e-12)
    (note,) = [w.message for w in run.warnings if w.code == "sign_from_direction"]
    assert f"negative in {np.count_nonzero(sign < 0)} of 400 samples, by the column dir" in note
    assert f"{STOPPED.sum()} are a stop with a factor of 0, and the cell is not 0 in " in note
    assert note.endswith("the motor is taken as braked, which is 0 V")


@pytest.mark.parametrize(("letter", "sign"), [("F", 1), ("R", -1), ("L", -1)])
def test_letters_of_a_motor_that_turns_one_way_and_stops(letter: str, sign: int) -> None:
    """R beside N alone is reverse; which way that is, the signs of current and speed tell."""
    data = board(np.where(STOPPED, "N", letter))

    run = read_run(data, mapping=mapped("voltage_V=pwm * dir * 48"))

    expected = np.where(STOPPED, 0.0, sign * np.abs(RECORD["voltage_V"]))
    assert run.voltage == pytest.approx(expected, rel=1e-12)


def test_codes_of_a_direction_are_stop_forward_and_reverse() -> None:
    """1 and 2 as an enumeration of a controller; 0 only where the duty is zero."""
    data = board(np.where(STOPPED, 0, np.where(SIGN > 0, 1, 2)))
    with pytest.raises(AbsurdValue, match=r"column dir: 0 is forward or a stop; .* write fwd, rev"):
        read_run(data, mapping=mapped("voltage_V=pwm * dir * 48"))
    data.loc[STOPPED, "pwm"] = 0.0

    run = read_run(data, mapping=mapped("voltage_V=pwm * dir * 48"))

    assert run.voltage == pytest.approx(np.where(STOPPED, 0.0, RECORD["voltage_V"]), rel=1e-12)
    (note,) = [w.message for w in run.warnings if w.code == "sign_from_direction"]
    assert "(1 is forward, 2 reverse, 0 a stop), by the column dir; 60 are a stop" in note
    assert "braked" not in note


def test_current_that_flows_at_a_stop_has_no_sign() -> None:
    """Braking turns the current round, which no direction of the voltage says."""
    data = board(np.where(STOPPED, "stop", np.where(SIGN > 0, "fwd", "rev")))
    data["current_A"] = np.abs(data["current_A"])

    with pytest.raises(AbsurdValue, match=r"column current_A: .* stands at a stop, expected is 0"):
        read_run(data, mapping=mapped("current_A=current_A * dir", "voltage_V=pwm * dir * 48"))


def test_sign_comes_before_the_offset_and_two_channels_share_it() -> None:
    """Contract of a mapping: value = (cell * sign * scale + offset) in the unit."""
    data = board(SIGN, current_mA=1e3 * np.abs(RECORD["current_A"]) + 1.0).drop(columns="current_A")
    mapping = mapped("voltage_V=pwm * dir * 48", "current_A=current_mA * dir * 2 / 4 + 3 in mA")

    run = read_run(data, mapping=mapping)

    expected = 1e-3 * (SIGN * data["current_mA"].to_numpy() * 0.5 + 3.0)
    np.testing.assert_allclose(run.current, expected, rtol=1e-12)


def test_duty_with_a_direction_is_multiplied_by_a_constant_bus() -> None:
    """48 V times the signed duty."""
    mapping = mapped("duty=pwm * dir in ratio", "bus_voltage_V=48")

    run = read_run(board(SIGN), mapping=mapping)

    assert run.voltage == pytest.approx(RECORD["voltage_V"], rel=1e-12)


@pytest.mark.parametrize(
    ("cell", "error", "message"),
    [
        ("up", NotANumber, r"row 5, column dir: 'up' is no direction; expected 1, 0 or -1"),
        ("2", AbsurdValue, r"row 5, column dir: 2 is no direction"),
        ("", Exception, r"row 5, column dir: the cell is blank"),
    ],
)
def test_other_directions_are_refused(
    tmp_path: Path, cell: str, error: type[Exception], message: str
) -> None:
    """The message names the cell and what is expected."""
    words = np.where(SIGN > 0, "1", "-1").tolist()
    words[3] = cell
    path = tmp_path / "run.csv"
    board(words).to_csv(path, index=False)

    with pytest.raises(error, match=message):
        read_run(path, mapping=mapped("voltage_V=pwm * dir * 48"))


def test_missing_column_of_a_sign_is_named() -> None:
    """A misspelt direction is no silent plus."""
    with pytest.raises(MappingError, match="there is no column 'drection' for the sign of voltage"):
        read_run(board(SIGN), mapping=mapped("voltage_V=pwm * drection * 48"))


def test_magnitudes_beside_a_direction_give_the_line_to_type() -> None:
    """The correction, typed, gives the voltage of the record; the other sign is reversed."""
    columns = motor()
    voltage, columns["voltage_V"] = columns["voltage_V"], np.abs(columns["voltage_V"])
    columns["motor dir"] = (voltage > 0.0).astype(float)
    (found,) = check_runs([read_run(pd.DataFrame(columns), name="run.csv")]).findings
    assert found.code == "unsigned_channel"
    assert found.corrections == ("run.csv:voltage_V=voltage_V * motor dir in V",)

    run = read_run(pd.DataFrame(columns), name="run.csv", mapping=mapped(*found.corrections))
    np.testing.assert_array_equal(run.voltage, voltage)
    assert check_runs([run]).findings == ()

    columns["motor dir"] = 1.0 - columns["motor dir"]
    run = read_run(pd.DataFrame(columns), name="run.csv", mapping=mapped(*found.corrections))
    (found,) = check_runs([run]).findings
    assert found.corrections == ("run.csv:voltage_V=voltage_V * motor dir * -1",)
    run = read_run(pd.DataFrame(columns), name="run.csv", mapping=mapped(*found.corrections))
    np.testing.assert_array_equal(run.voltage, voltage)


def test_magnitudes_alone_say_how_a_direction_is_mapped() -> None:
    """No column has the name of a direction."""
    columns = motor()
    columns["voltage_V"] = np.abs(columns["voltage_V"])

    (found,) = check_runs([read_run(pd.DataFrame(columns))]).findings

    assert found.corrections == ()
    assert "voltage_V=HEADER * DIRECTION" in str(found)


def test_constants_and_rows_replace_columns(tmp_path: Path) -> None:
    """A step of 12 V at 23 degC, sampled at 1 kHz, with current and speed alone."""
    path = tmp_path / "step.csv"
    pd.DataFrame({name: RECORD[name] for name in ("current_A", "speed_rad_s")}).to_csv(
        path, index=False
    )
    settings = ("voltage_V=12000 in mV", "time_s=row / 1000", "temperature_degC=23")

    run = read_run(path, mapping=mapped(*settings))

    assert np.all(run.voltage == 12.0)
    assert run.temperature is not None
    assert np.all(run.temperature == 23.0)
    np.testing.assert_allclose(run.time, np.arange(400) / 1e3, rtol=1e-12)
    assert run.sources["voltage_V"].entry()["method"] == "constant"
    assert [warning.code for warning in run.warnings] == ["time_from_rows"]
    # The mapping as understood reads the same run.
    saved: Any = check([path], mapped(*settings)).mapping()
    assert saved["voltage_V"] == {"value": 12000.0, "unit": "mV"}
    np.testing.assert_array_equal(read_run(path, mapping=saved).table(), run.table())
    with pytest.raises(MissingColumn) as caught:
        read_run(path)
    assert {"voltage_V": {"value": "VOLTS"}} in caught.value.examples
    assert {"time_s": {"column": "row", "scale": "SECONDS_PER_SAMPLE"}} in caught.value.examples


@pytest.mark.parametrize(
    ("above", "times", "settings"),
    [
        ("Horizontal Units,s\nVertical Units,V\nTIME,{}\n", (), ["time_s=TIME"]),
        ("X,{},Start,Increment,\nSequence,Volt,0,1e-3\n", ("",), ["time_s=row / 1000"]),
    ],
)
def test_files_of_one_channel_are_joined(
    tmp_path: Path, above: str, times: tuple[str, ...], settings: list[str]
) -> None:
    """Each file says what to do, and their columns side by side are a run."""
    values = (RECORD["voltage_V"], RECORD["current_A"] / 10.0, RECORD["speed_rad_s"])
    columns: list[list[str]] = []
    for number, cells in enumerate(values, start=1):
        path = tmp_path / f"CH{number}.csv"
        # Rigol numbers the samples.
        first = map(repr, range(400)) if times else map(repr, RECORD["time_s"].tolist())
        lines = [",".join(row) for row in zip(first, map(repr, cells.tolist()), strict=True)]
        end = "".join(f"{line},{','.join(times)}\n" if times else f"{line}\n" for line in lines)
        path.write_text(above.format(f"CH{number}") + end, encoding="utf-8")
        with pytest.raises(MissingColumn, match="motorid join FILE FILE FILE --out"):
            read_run(path)
        cut = slice(1, 2) if times or columns else slice(0, 2)
        rows = path.read_text(encoding="utf-8").splitlines()
        columns.append([",".join(row.split(",")[cut]) for row in rows])
    joined = tmp_path / "run.csv"
    joined.write_text("\n".join(map(",".join, zip(*columns, strict=True))) + "\n", encoding="utf-8")

    run = read_run(
        joined,
        mapping=mapped(
            *settings, "voltage_V=CH1", "current_A=CH2 * 10", "speed_rad_s=CH3 in rad/s"
        ),
    )

    np.testing.assert_allclose(run.voltage, RECORD["voltage_V"], rtol=1e-12)
    np.testing.assert_allclose(run.current, RECORD["current_A"], rtol=1e-12)
    np.testing.assert_array_equal(run.speed, RECORD["speed_rad_s"])


def test_column_named_row_has_priority() -> None:
    """Its cells count by two."""
    data = pd.DataFrame(RECORD).drop(columns="time_s").assign(row=2.0 * np.arange(400))

    run = read_run(data, mapping=mapped("time_s=row * 0.001"))

    np.testing.assert_allclose(np.diff(run.time), 2e-3)


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ({"voltage_V": {"value": 12, "column": "U"}}, "constant value and the key 'column'"),
        ({"voltage_V": {"value": "12"}}, "voltage_V has the value"),
        (
            {"voltage_V": {"value": None, "unit": "mV"}},
            "its value is missing; give it as a number in mV",
        ),
        ({"speed_rad_s": {"value": 0}}, "speed_rad_s has the key 'value'"),
        ({"time_s": {"column": "t", "sign": "dir"}}, "time_s has the key 'sign'"),
        ({"voltage_V": {"column": "U", "sign": " "}}, 'voltage_V has no sign; add "sign"'),
    ],
)
def test_invalid_entries_are_refused(entry: dict[str, object], message: str) -> None:
    """The message gives channel and key."""
    with pytest.raises(MappingError, match=re.escape(message)):
        read_run(pd.DataFrame(RECORD), mapping=entry)


def test_products_of_a_map_text() -> None:
    """Headers keep their own operators; a factor must be a number where no sign is possible."""
    assert mapped("voltage_V=U / V * 2")["voltage_V"] == {"column": "U / V", "scale": 2.0}
    assert mapped("voltage_V=a / b")["voltage_V"] == {"column": "a / b"}
    assert mapped("time_s=t / 4 * 2")["time_s"] == {"column": "t", "scale": 0.5}
    assert mapped("speed_rad_s=n * my dir in rpm")["speed_rad_s"] == {
        "column": "n",
        "sign": "my dir",
        "unit": "rpm",
    }
    with pytest.raises(OptionError, match="'dir' is not a number"):
        mapped("position_rad=count * dir")
    with pytest.raises(OptionError, match="'2,5' is not a number"):
        mapped("current_A=CH2 * 2,5")


def test_page_lists_every_direction() -> None:
    """docs/run-files.md has the words of the module, in two lists."""
    text = (Path(__file__).parents[2] / "docs" / "run-files.md").read_text("utf-8")
    (line,) = [line for line in text.splitlines() if line.startswith("The cells of the direction")]
    lists = [re.findall(r"`([^`]+)`", part) for part in line.split(";")]

    assert {
        word: sign for words, sign in zip(lists, (1.0, -1.0, STOP), strict=True) for word in words
    } == (DIRECTIONS)
