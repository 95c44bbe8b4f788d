"""Current sensor whose gain falls with the current, as that of an amplifier near its limit."""

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
from identification.surrogates.laws import CurrentSaturation
from tests.effects.hidden import all_but

ROWS, INTERVAL = 800, 1e-3
WITHHELD = all_but(
    "flux_saturation", "inductance_saturation", "brush_drop", "current_filter", "self_heating"
)
TEMPERATURES = (30.0, 65.0, 100.0, 50.0)


def outcome_of(seed: int, share: float) -> tuple[Outcome, float]:
    """Outcome of the search, and the true Ra25 [ohm].

    The sensor reads A tanh(i / A), where A is the largest current of the first run over `share`.
    The simulator of the benches shares no code with the model.
    """
    rng = np.random.default_rng(seed)
    motor = drawn_motor(rng)
    time = INTERVAL * np.arange(ROWS, dtype=np.float64)
    runs: list[Run] = []
    limit = 0.0
    for number, degrees in enumerate(TEMPERATURES):
        command = voltages(motor, time, number, False, rng)
        warm = np.full(ROWS, degrees)
        hidden, drive = Hidden(), Drive(motor.rated_voltage)
        true = simulated(motor, hidden, drive, time, command, warm, np.zeros(ROWS), 0.0)
        current = true.current
        if share > 0.0:
            limit = limit if runs else float(np.abs(current).max()) / share
            current = limit * np.tanh(current / limit)
        current = current + 0.004 * motor.rated_current * rng.standard_normal(ROWS)
        speed = true.speed + 0.003 * motor.rated_speed * rng.standard_normal(ROWS)
        runs.append(Run(f"run{number}.csv", "0" * 64, time, true.command, current, speed, warm))
    campaign = campaign_of(runs[:3], runs[3:])
    return search(fit_declared(campaign.training, "zoh"), campaign, withheld=WITHHELD), motor.Ra25


@pytest.mark.parametrize("seed", [3, 4])
def test_a_current_sensor_that_saturates_is_named_and_leaves_the_resistance(seed: int) -> None:
    """At the largest current the sensor reads 12 % too little."""
    outcome, resistance = outcome_of(seed, 0.65)

    assert [effect.name for effect in outcome.effects] == ["unlisted"]
    (term,) = outcome.fit.simulator.model.terms
    assert isinstance(term, CurrentSaturation)
    assert outcome.fit.by_name["Ra25"] == pytest.approx(resistance, rel=0.005)


def test_a_linear_current_sensor_does_not_saturate() -> None:
    """The same motor, with the same noise, has no effect."""
    assert outcome_of(3, 0.0)[0].effects == ()


def test_a_saturation_comes_back_from_a_result() -> None:
    """Its settings restore it, as for each unlisted term."""
    term = CurrentSaturation(20.0)

    entry = {"name": "unlisted", "equation": "sensor", "settings": term.settings}
    assert term_of(entry) == term
