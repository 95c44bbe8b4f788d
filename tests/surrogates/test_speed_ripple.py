"""Speed sensor whose gain is periodic in the shaft angle, as that of a tachogenerator."""

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
from identification.surrogates.ripple import SpeedRipple
from tests.effects.hidden import all_but

ROWS, INTERVAL = 1200, 1e-3
WITHHELD = all_but(
    "cogging_torque", "speed_offset", "speed_filter", "shaft_compliance", "load_torque"
)
TEMPERATURES = (30.0, 65.0, 100.0, 50.0)


def outcome_of(seed: int, order: int, share: float) -> Outcome:
    """Outcome of the search for a ripple of a share of the speed.

    The simulator of the benches shares no code with the model.  The angle is not logged.  A ripple
    is resolved if the shaft turns by less than half a period between samples.
    """
    rng = np.random.default_rng(seed)
    motor = drawn_motor(rng)
    time = INTERVAL * np.arange(ROWS, dtype=np.float64)
    shown = min(1.0, 0.5 * np.pi / (order * INTERVAL * motor.rated_speed))
    runs = []
    for number, degrees in enumerate(TEMPERATURES):
        command = shown * voltages(motor, time, number, False, rng)
        warm = np.full(ROWS, degrees)
        hidden, drive = Hidden(), Drive(motor.rated_voltage)
        true = simulated(motor, hidden, drive, time, command, warm, np.zeros(ROWS), 0.0)
        angle = rng.uniform(0, 2 * np.pi) + INTERVAL * np.cumsum(true.speed)
        current = true.current + 0.004 * motor.rated_current * rng.standard_normal(ROWS)
        noise = 0.003 * motor.rated_speed * rng.standard_normal(ROWS)
        speed = true.speed * (1.0 + share * np.sin(order * angle)) + noise
        runs.append(Run(f"run{number}.csv", "0" * 64, time, true.command, current, speed, warm))
    campaign = campaign_of(runs[:3], runs[3:])
    return search(fit_declared(campaign.training, "zoh"), campaign, withheld=WITHHELD)


@pytest.mark.parametrize(("seed", "order"), [(3, 14), (4, 1)])
def test_the_ripple_of_a_speed_sensor_is_named_with_its_order(seed: int, order: int) -> None:
    """Fourteen segments of a commutator, or an eccentric disc; 4 % of the speed."""
    outcome = outcome_of(seed, order, 0.04)

    assert [effect.name for effect in outcome.effects] == ["unlisted"]
    (term,) = outcome.fit.simulator.model.terms
    assert isinstance(term, SpeedRipple)
    assert outcome.fit.by_name["unlisted.order"] == pytest.approx(order, rel=0.01)
    for state in outcome.fit.states:
        assert np.hypot(*state[2:4]) == pytest.approx(0.04, rel=0.1)


def test_a_speed_sensor_without_ripple_has_none() -> None:
    """The same motor, with the same noise, has no effect."""
    assert outcome_of(3, 14, 0.0).effects == ()


def test_a_ripple_comes_back_from_a_result() -> None:
    """Its settings restore it, as for each unlisted term."""
    term = SpeedRipple(1.0, logged=False, harmonics=3, angle="integrated")

    entry = {"name": "unlisted", "equation": "sensor", "settings": term.settings}
    assert term_of(entry) == term
