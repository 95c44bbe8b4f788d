"""Recognition of quantity and unit in a header."""

from __future__ import annotations

import pytest

from identification.ingest import describe_column
from identification.ingest.columns import similar_columns
from identification.ingest.names import is_units_row, similar_to


@pytest.mark.parametrize(
    ("text", "quantity", "unit"),
    [
        ("speed [rpm]", "speed", "rpm"),
        ("Speed{rpm}", "speed", "rpm"),
        ("n / (1/min)", "speed", "rpm"),
        ("speed rad/s", "speed", "rad/s"),
        ("omega_rad_per_s", "speed", "rad/s"),
        ("motorSpeedRpm", "speed", "rpm"),
        ("Motor Current (mA)", "current", "mA"),
        ("I_mA", "current", "mA"),
        ("U/V", "voltage", "V"),
        ("t [ms]", "time", "ms"),
        ("T [degC]", "temperature", "degC"),
        ("theta [deg]", "angle", "deg"),
        ("theta [degC]", "temperature", "degC"),
        ("kelvin", "temperature", "K"),
        ("TIME_S", "time", "s"),
        ("Klemmenspannung [V]", "voltage", "V"),
        ("Ankerspannung / mV", "voltage", "mV"),
        ("Ankerstrom (mA)", "current", "mA"),
        ("Motordrehzahl [1/min]", "speed", "rpm"),
        ("Istdrehzahl in U/min", "speed", "rpm"),
        ("Wicklungstemperatur [°C]", "temperature", "degC"),
        ("Rotorwinkel [°]", "angle", "deg"),
        ("motorspeed_rpm", "speed", "rpm"),
        ("windingTemperature_degC", "temperature", "degC"),
        ("Tempo (ms)", "time", "ms"),
        ("ms_today", "time", "ms"),
        ("Tensão [V]", "voltage", "V"),
        ("Corrente (mA)", "current", "mA"),
        ("velocidad_angular_rad/s", "speed", "rad/s"),
        ("vitesse [rpm]", "speed", "rpm"),
    ],
)
def test_header_contains_one_quantity_and_its_unit(text: str, quantity: str, unit: str) -> None:
    """The forms that docs/run-files.md lists."""
    column = describe_column(0, [text])

    assert column.quantities == {quantity}
    assert column.unit is not None
    assert column.unit.name == unit


@pytest.mark.parametrize(
    "text", ["V", "speed", "t", "theta", "Motor current", "rot. velocity", "A"]
)
def test_header_without_unit_has_none(text: str) -> None:
    """Single letters may be names or units, and a name alone gives no unit."""
    assert describe_column(0, [text]).unit is None


@pytest.mark.parametrize(
    "text",
    [
        "1st motor velocity",
        "m1vel",
        "speed_set_rpm",
        "CH1",
        "",
        "x" * 9999,
        "Sollspannung [V]",
        "Solldrehzahl [1/min]",
        "Gehäusetemperatur [°C]",
        "motort",
    ],
)
def test_header_that_is_no_exact_name_has_no_quantity(text: str) -> None:
    """A number, a set point, no name at all."""
    assert describe_column(0, [text]).quantities == frozenset()


@pytest.mark.parametrize(
    "text", ["battery voltage [V]", "Batteriespannung [V]", "V_bus (V)", "Vdc", "VDC"]
)
def test_voltage_of_the_supply_is_not_that_of_the_motor(text: str) -> None:
    """A chopper lies between them."""
    assert "voltage" not in describe_column(0, [text]).quantities


@pytest.mark.parametrize(
    ("text", "quantity", "similar"),
    [
        ("1st motor velocity", "speed", True),
        ("m1vel", "speed", True),
        ("m1setvel", "speed", False),
        ("1st motor set speed", "speed", False),
        ("voltage_ref", "voltage", False),
        ("battery voltage", "voltage", True),
        ("battery voltage", "current", False),
        ("amps_left", "current", True),
        ("motorcur", "current", True),
        ("Iq_measured", "current", True),
        ("Iq_setpoint", "current", False),
        ("wheelrpm", "speed", True),
        ("Sample", "current", False),
        ("Timestamp", "current", False),
        ("accuracy", "current", False),
        ("fill level", "speed", False),
        ("purpose", "angle", False),
    ],
)
def test_similar_header_is_offered_unless_it_is_a_command(
    text: str, quantity: str, similar: bool
) -> None:
    """Proposing a set point as a measurement would suggest a wrong fit."""
    assert similar_to(text, quantity) is similar


def test_units_row_is_distinguished_from_names() -> None:
    """At least half of the non-empty cells are units, with or without brackets."""
    assert is_units_row(["ms", "rad/s", "ticks", "A", ""])
    assert is_units_row(["[s]", "(V)"])
    assert not is_units_row(["time", "speed", "current", "A"])
    assert not is_units_row(["", ""])


@pytest.mark.parametrize(
    ("text", "channel", "similar"),
    [
        ("Ucell [V]", "voltage_V", True),
        ("Ucell [V]", "current_A", False),
        ("T_case [degC]", "temperature_degC", True),
        ("Ucell_set [V]", "voltage_V", False),
        ("V_bus (V)", "voltage_V", False),
    ],
)
def test_unknown_name_with_the_unit_of_a_channel_is_offered(
    text: str, channel: str, similar: bool
) -> None:
    """The unit names the quantity; a set point and a supply have one, too, and are not offered."""
    column = describe_column(0, [text])

    assert similar_columns(channel, [column]) == [column] * similar
