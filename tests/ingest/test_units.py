"""Table of units: definitions, spellings and unknown units."""

from __future__ import annotations

import math

import pytest

from identification.ingest.units import (
    CHANNEL_QUANTITIES,
    UNITS,
    Unit,
    accepted_spellings,
    canonical_unit,
    find_unit,
    unit_in_another_case,
)
from identification.quantities import CHANNEL_UNITS


@pytest.mark.parametrize("unit", UNITS, ids=lambda unit: unit.name.replace("/", " per "))
def test_every_spelling_finds_its_own_unit(unit: Unit) -> None:
    """A spelling belongs to exactly one unit, so its lookup returns that unit."""
    for spelling in unit.spellings:
        assert find_unit(spelling) is unit
        assert find_unit(f" {spelling} ") is unit
    for word in unit.words.split():
        assert find_unit(word.upper()) is unit
        assert find_unit(word.title()) is unit


@pytest.mark.parametrize(
    ("spelling", "value", "expected"),
    [
        ("rpm", 60.0, 2.0 * math.pi),
        ("U/min", 60.0, 2.0 * math.pi),
        ("krpm", 0.06, 2.0 * math.pi),
        ("rev/s", 1.0, 2.0 * math.pi),
        ("deg/s", 360.0, 2.0 * math.pi),
        ("turns", 1.0, 2.0 * math.pi),
        ("turns/s", 1.0, 2.0 * math.pi),
        ("deg/sec", 360.0, 2.0 * math.pi),
        ("radians/s", 1.0, 1.0),
        ("degF", 32.0, 0.0),
        ("degF", 212.0, 100.0),
        ("K", 273.15, 0.0),
        ("K", 373.15, 100.0),
        ("mV", 1500.0, 1.5),
        ("min", 2.0, 120.0),
    ],
)
def test_unit_converts_as_it_is_defined(spelling: str, value: float, expected: float) -> None:
    """A turn is 2 pi rad; ice melts at 32 degF and 273.15 K, water boils at 212 and 373.15."""
    unit = find_unit(spelling)

    assert unit is not None
    assert (value + unit.shift) * unit.factor == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize(
    "text", ["", "MA", "MV", "Ms", "Nm", "oz-in", "dB", "1/s", "Hz", "ticks", "degree C rms", "r/s"]
)
def test_unit_that_is_not_in_the_table_is_unknown(text: str) -> None:
    """Mega units, units of other quantities, and rates that may be turns or radians."""
    assert find_unit(text) is None


@pytest.mark.parametrize(
    ("written", "name"),
    [
        ("rad·s⁻¹", "rad/s"),
        ("min^-1", "rpm"),
        ("1 / min", "rpm"),
        ("℃", "degC"),
        ("ºC", "degC"),
        ("μs", "us"),
        ("µA", "uA"),
        ("°F", "degF"),
        ("deg C", "degC"),
    ],
)
def test_equivalent_characters_give_the_same_unit(written: str, name: str) -> None:
    """Superscripts, product signs, both letters mu and all degree signs."""
    unit = find_unit(written)

    assert unit is not None
    assert unit.name == name


def test_every_channel_has_its_si_unit_in_the_table() -> None:
    """The SI units of the interface have factor one and no offset."""
    for channel, name in CHANNEL_UNITS.items():
        unit = canonical_unit(channel)

        assert (unit.name, unit.factor, unit.shift) == (name, 1.0, 0.0)
        assert unit.quantity == CHANNEL_QUANTITIES[channel]
        assert name in accepted_spellings(unit.quantity)


def test_unit_in_capitals_is_known_for_the_hint_only() -> None:
    """MA may mean mA, which the user must confirm."""
    unit = unit_in_another_case("MA")

    assert unit is not None
    assert unit.name == "mA"
    assert unit_in_another_case("dB") is None
