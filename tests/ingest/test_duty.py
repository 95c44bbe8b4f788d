"""Runs of a motor behind a chopper: the voltage is duty cycle times bus voltage."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from identification import errors
from identification.checks.finding import exchange, factor
from identification.ingest import read_run
from identification.preview import check
from tests.ingest.samples import Array, record, write

RECORD = record(400)
# A supply with an inner resistance, so that the bus voltage varies with the load.
BUS = 48.0 - 0.3 * RECORD["current_A"]


def chopped(duty: str, bus: str, percent: float = 1.0) -> dict[str, Array]:
    """The record with the columns duty and bus voltage, of these names, for the voltage."""
    factors = {duty: RECORD["voltage_V"] / BUS * percent, bus: BUS}
    return {name: values for name, values in RECORD.items() if name != "voltage_V"} | factors


@pytest.mark.parametrize(
    ("duty", "bus", "percent"),
    [
        ("duty [%]", "bus voltage [V]", 100.0),
        ("duty_percent", "bus_voltage_V", 100.0),
        ("PWM duty cycle (ratio)", "DC link voltage [V]", 1.0),
        ("Tastgrad in %", "Zwischenkreisspannung/V", 100.0),
        ("duty_ratio", "vbat_mV", 1.0),
        ("PWM [%]", "V_bus [V]", 100.0),
        ("PWM duty cycle [%]", "Power supply voltage [V]", 100.0),
        ("duty [%]", "Vdc [VDC]", 100.0),
    ],
)
def test_voltage_is_duty_times_bus_voltage(duty: str, bus: str, percent: float) -> None:
    """The expected voltage is that from which the duty was computed."""
    columns = chopped(duty, bus, percent)
    columns[bus] = columns[bus] * (1e3 if bus.endswith("mV") else 1.0)

    run = read_run(pd.DataFrame(columns))

    assert run.voltage == pytest.approx(RECORD["voltage_V"], abs=1e-9)
    assert run.sources["voltage_V"].method == "duty"
    assert [w.code for w in run.warnings].count("voltage_from_duty") == 1
    # Both columns are used.
    assert "unused_columns" not in [w.code for w in run.warnings]


@pytest.mark.parametrize("name", ["pwm_cmd", "PWM_input", "duty_set"])
def test_a_commanded_duty_is_proposed_for_a_missing_voltage(name: str) -> None:
    """Microcontrollers log the command; only the user knows the voltage per count."""
    columns = {key: values for key, values in RECORD.items() if key != "voltage_V"}
    with pytest.raises(errors.MissingColumn) as caught:
        read_run(pd.DataFrame(columns | {name: np.round(255 * RECORD["voltage_V"] / 48.0)}))
    assert f"the voltage may be '{name}' times" in str(caught.value)
    assert {"voltage_V": {"column": name, "scale": "VOLT_PER_DUTY"}} in caught.value.examples


def test_a_duty_times_a_constant_is_a_voltage_with_the_remarks_of_a_product() -> None:
    """The supply current of a chopper, which boards measure, is not that of the motor."""
    columns = {key: values for key, values in RECORD.items() if key != "voltage_V"}
    columns["PWM_input"] = 100.0 * RECORD["voltage_V"] / 48.0
    mapping = {"voltage_V": {"column": "PWM_input", "scale": 0.48}}

    run = read_run(pd.DataFrame(columns), mapping=mapping)

    (note,) = [w.message for w in run.warnings if w.code == "voltage_from_duty"]
    assert "PWM_input times 0.48 V, as of a constant supply" in note
    assert "the supply current of a chopper is the duty times it" in note


@pytest.mark.parametrize("name", ["u_motor", "PWM voltage [V]"])
def test_a_measured_voltage_with_a_scale_is_no_duty(name: str) -> None:
    """The scale is that of a divider."""
    columns = {key: values for key, values in RECORD.items() if key != "voltage_V"}
    columns[name] = RECORD["voltage_V"] / 11.0
    mapping = {"voltage_V": {"column": name, "scale": 11.0, "unit": "V"}}

    run = read_run(pd.DataFrame(columns), mapping=mapping)

    assert "voltage_from_duty" not in [w.code for w in run.warnings]


def test_a_direction_beside_a_commanded_duty_is_its_sign_in_the_proposal() -> None:
    """A mapping without it gives a magnitude, which is refused later."""
    columns = {key: values for key, values in RECORD.items() if key != "voltage_V"}
    columns["pwm_cmd"] = np.abs(RECORD["voltage_V"])
    columns["dir"] = np.sign(RECORD["voltage_V"])
    with pytest.raises(errors.MissingColumn, match="the sign may be that of 'dir'") as caught:
        read_run(pd.DataFrame(columns))
    entry = {"column": "pwm_cmd", "scale": "VOLT_PER_DUTY", "sign": "dir"}
    assert {"voltage_V": entry} in caught.value.examples


def test_logged_voltage_has_priority() -> None:
    """The voltage at the motor contains the drops of the chopper, the product does not."""
    columns = {**RECORD, **chopped("duty [%]", "bus voltage [V]", 90.0)}

    run = read_run(pd.DataFrame(columns))

    assert np.array_equal(run.voltage, RECORD["voltage_V"])
    assert run.sources["voltage_V"].method is None


def test_mapping_reads_locked_antiphase_modulation() -> None:
    """At 50 % duty the mean voltage is zero: v = (2 d - 1) V, here with d in percent."""
    ratio = RECORD["voltage_V"] / BUS
    columns = chopped("ch1", "ch2") | {"ch1": 50.0 * (ratio + 1.0)}
    mapping = {
        "duty": {"column": "ch1", "scale": 2.0, "offset": -100.0, "unit": "%"},
        "bus_voltage_V": {"column": "ch2"},
    }

    run = read_run(pd.DataFrame(columns), mapping=mapping)

    assert run.voltage == pytest.approx(RECORD["voltage_V"], abs=1e-9)


def test_mapping_as_understood_reads_the_same_voltage(tmp_path: Path) -> None:
    """The mapping that `check` saves contains both columns."""
    path = tmp_path / "run.csv"
    path.write_bytes(write(chopped("duty [%]", "bus voltage [V]", 100.0)))
    found = check(path)
    mapping = found.mapping()
    assert {"duty", "bus_voltage_V"} <= set(mapping)
    assert "voltage_V" not in mapping

    assert np.array_equal(read_run(path, mapping=mapping).voltage, found.runs[0].voltage)


def test_correction_of_the_voltage_is_one_of_the_duty() -> None:
    """A reversed voltage is corrected at the column from which the sign comes."""
    run = read_run(pd.DataFrame(chopped("duty [%]", "bus voltage [V]", 100.0)), name="a.csv")

    assert factor(run, "voltage_V", -1.0) == "a.csv:duty=duty [%] * -1 in %"
    assert exchange(run, "voltage_V", "current_A") == ()


@pytest.mark.parametrize(
    ("columns", "mapping", "error", "words"),
    [
        (chopped("duty", "bus voltage [V]"), None, errors.AmbiguousUnit, "write one of ratio, %"),
        (chopped("duty [V]", "bus voltage [V]"), None, errors.WrongUnit, "V is a unit of voltage"),
        (
            chopped("duty [%]", "u2"),
            None,
            errors.MissingColumn,
            r"'duty \[%\]' times a column of the bus voltage",
        ),
        (
            chopped("ch1", "ch2"),
            {"duty": {"column": "ch1"}},
            errors.MissingColumn,
            "no column for bus_voltage_V.* map both",
        ),
        (
            chopped("ch1", "ch2"),
            {"duty": {"column": "ch1"}, "voltage_V": {"column": "ch2"}},
            errors.MappingError,
            "both voltage_V and duty",
        ),
        (
            {**chopped("ch1", "ch2"), "duty a [%]": BUS, "duty b [%]": BUS},
            {"bus_voltage_V": {"column": "ch2"}},
            errors.MissingColumn,
            "no column for duty",
        ),
    ],
)
def test_incomplete_factors_are_refused_with_the_remedy(
    columns: dict[str, Array],
    mapping: dict[str, object] | None,
    error: type[errors.RunFileError],
    words: str,
) -> None:
    """No unit and no factor is assumed: each fault has its own error."""
    with pytest.raises(error, match=words) as caught:
        read_run(pd.DataFrame(columns), mapping=mapping)

    # Only the fault itself is reported.
    assert caught.value.further == ()
