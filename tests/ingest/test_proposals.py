"""Mappings that messages propose: columns that they name, and those that they leave out."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from identification import errors
from identification.ingest import read_run
from tests.ingest.samples import Array, changed, record, write

RECORD = record()
UNNAMED = {name: values for name, values in RECORD.items() if name != "voltage_V"}


def refused(path: Path, content: bytes) -> errors.RunFileError:
    """The error with which a file is refused."""
    path.write_bytes(content)
    with pytest.raises(errors.RunFileError) as caught:
        read_run(path)
    return caught.value


@pytest.mark.parametrize(
    ("first", "unit"),
    [(1.772352e9, "s"), (1.772352e12, "ms"), (1.772352e15, "us"), (1.772352e18, "ns"), (0, "s")],
)
def test_a_time_since_1970_is_proposed_in_the_unit_of_this_century(
    tmp_path: Path, first: float, unit: str
) -> None:
    """The numbers are the first of March 2026, 08:00 UTC; from zero, the unit is not known."""
    steps = np.arange(40) * (10 ** (np.log10(first) // 1 - 9 - 3) if first > 2e9 else 1)
    text = write(RECORD).decode().splitlines()
    lines = [text[0].replace("time_s", "timestamp")]
    for step, line in zip(steps, text[1:], strict=True):
        lines.append(f"{int(first) + int(step)},{line.partition(',')[2]}")

    error = refused(tmp_path / "run3.csv", "\n".join([*lines, ""]).encode())

    assert type(error) is errors.AmbiguousUnit
    assert list(error.examples) == [{"time_s": {"column": "timestamp", "unit": unit}}]


@pytest.mark.parametrize(
    ("columns", "proposed"),
    [
        ({"vbus_voltage [V]": 24.0}, "vbus_voltage [V]"),
        ({"vbus_voltage [V]": 24.0, "Ucell [V]": 1.0}, "Ucell [V]"),
        ({"Shunt voltage [V]": 0.1, "vbus_voltage [V]": 24.0}, "vbus_voltage [V]"),
    ],
)
def test_the_voltage_of_a_supply_is_proposed_for_want_of_another(
    columns: dict[str, float], proposed: str
) -> None:
    """A motor without a chopper has the voltage of its supply; the message says the condition."""
    logged = {name: np.full(40, value) for name, value in columns.items()}
    with pytest.raises(errors.MissingColumn) as caught:
        read_run(pd.DataFrame(UNNAMED | logged))

    assert caught.value.examples[0] == {"voltage_V": {"column": proposed}}
    is_said = "of the motor only without a chopper" in str(caught.value)
    assert is_said == (proposed == "vbus_voltage [V]")


def test_no_voltage_of_a_supply_is_proposed_beside_a_duty_cycle() -> None:
    """The voltage of the motor is then the product, whatever the name of the supply."""
    columns: dict[str, Array] = {"VIN (mV)": np.full(40, 24e3), "duty target": np.ones(40)}
    columns["duty"] = columns["duty target"]
    with pytest.raises(errors.MissingColumn) as caught:
        read_run(pd.DataFrame(UNNAMED | columns))

    assert "voltage_V may be" not in str(caught.value)
    entry = {"column": "duty", "scale": "VOLT_PER_DUTY"}
    assert {"voltage_V": entry} in caught.value.examples


def test_channels_of_a_keysight_unit_are_proposed_and_its_alarms_are_not(tmp_path: Path) -> None:
    """The header is that of a data file of the 34972A; ADC are amperes only if the user says so."""
    content = changed()
    header = b"Time [s],101 (VDC),102 (ADC),103 (VDC),Alarm 101"
    body = content.split(b"\n", 1)[1]

    error = refused(tmp_path / "run3.csv", header + b"\n" + body)

    [example] = error.examples
    assert example == {
        "voltage_V": {"column": "101 (VDC)", "scale": "V_PER_V"},
        "current_A": {"column": "102 (ADC)", "scale": "NUMBER"},
        "speed_rad_s": {"column": "103 (VDC)", "scale": "RAD_S_PER_V"},
    }


def test_a_unit_that_is_not_known_is_a_factor_in_the_proposal() -> None:
    """Counts per second of a drive, read in rad/s, would give another motor."""
    columns = {name: values for name, values in RECORD.items() if name != "speed_rad_s"}
    columns["Axis1.Velocity [cnt/sec]"] = RECORD["speed_rad_s"]
    with pytest.raises(errors.MissingColumn) as caught:
        read_run(pd.DataFrame(columns))

    entry = {"column": "Axis1.Velocity [cnt/sec]", "scale": "NUMBER"}
    assert caught.value.examples[0] == {"speed_rad_s": entry}


@pytest.mark.parametrize(
    ("title", "is_said"),
    [("vel_estimate", True), ("Axis1.rpm", False), ("Axis1.Velocity [rad/s]", False)],
)
def test_the_unit_of_a_speed_is_not_taken_from_the_proposal(title: str, *, is_said: bool) -> None:
    """ODrive logs turns per second, and a run read in rad/s would be that of another motor."""
    columns = {name: values for name, values in RECORD.items() if name != "speed_rad_s"}
    with pytest.raises(errors.MissingColumn) as caught:
        read_run(pd.DataFrame(columns | {title: RECORD["speed_rad_s"]}))

    assert (f"with the unit of '{title}' in place of rad/s" in str(caught.value)) == is_said


def test_units_of_duty_and_bus_voltage_are_asked_for_at_once() -> None:
    """VESC Tool writes both without a unit; one message per attempt would cost two."""
    factors = {"duty_cycle": RECORD["voltage_V"] / 24.0, "input_voltage": np.full(40, 24.0)}
    with pytest.raises(errors.AmbiguousUnit) as caught:
        read_run(pd.DataFrame(UNNAMED | factors))

    found = [caught.value, *caught.value.further]
    assert [list(error.examples[0]) for error in found] == [["duty"], ["bus_voltage_V"]]


def test_an_optional_channel_without_a_unit_may_be_left_out() -> None:
    """A position in unknown counts is not necessary for a run with a speed."""
    columns = RECORD | {"position": np.arange(40.0)}
    with pytest.raises(errors.AmbiguousUnit) as caught:
        read_run(pd.DataFrame(columns))

    assert caught.value.examples[-1] == {"position_rad": None}
    assert read_run(pd.DataFrame(columns), mapping=caught.value.examples[-1]).position is None


def test_a_cycle_counter_is_offered_as_a_time(tmp_path: Path) -> None:
    """Traces of CODESYS count cycles in their first column."""
    content = changed().replace(b"time_s", b"Cycle")

    error = refused(tmp_path / "run3.csv", content)

    assert {"time_s": {"column": "Cycle", "scale": "SECONDS_PER_SAMPLE"}} in error.examples
