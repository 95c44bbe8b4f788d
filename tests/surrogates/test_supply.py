"""Supply that sags behind a chopper, with the commanded voltage as log."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.benches.excitation import voltages
from benchmarks.benches.motors import drawn_motor
from benchmarks.benches.plant import Drive, Hidden, simulated
from identification.fit.campaign import campaign_of
from identification.fit.declared import fit_declared
from identification.ingest.run import Run
from identification.selection.outcome import Outcome
from identification.selection.search import search
from identification.surrogates.entry import term_of
from identification.surrogates.laws import SupplySag
from tests.effects.hidden import all_but

ROWS = 1500
WITHHELD = all_but(
    "brush_drop", "flux_saturation", "self_heating", "voltage_offset", "current_filter"
)
TEMPERATURES = (30.0, 65.0, 100.0, 50.0)


def outcome_of(seed: int, share: float) -> tuple[Outcome, float, float]:
    """What the search ends with, the resistance of the supply [ohm] and its voltage [V].

    The simulator of the benches has a supply of a share of Ra25; it shares no code with the model.
    """
    rng = np.random.default_rng(seed)
    motor = drawn_motor(rng)
    drive = Drive(motor.rated_voltage, source=share * motor.Ra25)
    time = 1e-3 * np.arange(ROWS, dtype=np.float64)
    runs = []
    for number, degrees in enumerate(TEMPERATURES):
        command = voltages(motor, time, number, False, rng)
        warm = np.full(ROWS, degrees)
        true = simulated(motor, Hidden(), drive, time, command, warm, np.zeros(ROWS), 0.0)
        current = true.current + 0.004 * motor.rated_current * rng.standard_normal(ROWS)
        speed = true.speed + 0.003 * motor.rated_speed * rng.standard_normal(ROWS)
        runs.append(Run(f"run{number}.csv", "0" * 64, time, true.command, current, speed, warm))
    campaign = campaign_of(runs[:3], runs[3:])
    outcome = search(fit_declared(campaign.training, "zoh"), campaign, withheld=WITHHELD)
    return outcome, drive.source, motor.rated_voltage


@pytest.mark.parametrize("seed", [3, 4])
def test_a_supply_behind_a_chopper_is_named_with_its_resistance(seed: int) -> None:
    """Known: the resistance at full duty and the voltage there, R (v_0 / V)^2 at v_0."""
    outcome, source, full = outcome_of(seed, 0.2)

    assert [effect.name for effect in outcome.effects] == ["unlisted"]
    (term,) = outcome.fit.simulator.model.terms
    assert isinstance(term, SupplySag)
    values = dict(zip(outcome.fit.coordinates.names, outcome.fit.values, strict=True))
    expected = source * (term.voltage_size / full) ** 2
    assert values["unlisted.resistance"] == pytest.approx(expected, rel=0.1)


def test_an_ideal_source_has_no_sag() -> None:
    """The same motor without a series resistance has no effect."""
    assert outcome_of(3, 0.0)[0].effects == ()


def test_a_sag_comes_back_from_a_result() -> None:
    """Its settings restore it, as for each unlisted term."""
    settings = {"voltage_size": 12.0, "resistance_size": 0.5}

    entry = {"name": "unlisted", "equation": "electrical", "settings": settings}
    assert term_of(entry) == SupplySag(12.0, 0.5)
