"""Sensors that read too little by a constant, and zero for small signals."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from benchmarks.benches.excitation import voltages
from benchmarks.benches.motors import drawn_motor
from benchmarks.benches.plant import Drive, Hidden, simulated
from identification.effects.effect import Candidate, effects_of
from identification.fit.declared import fit_declared
from identification.fit.solve import Fit
from identification.ingest.run import Run
from identification.model.excitation import records_of
from identification.model.term import Channel
from identification.selection.candidates import scales_of
from identification.selection.refit import refitted_with
from identification.selection.start import Start
from identification.surrogates.dead_zone import SensorDeadZone
from identification.surrogates.entry import term_of

ROWS, INTERVAL = 1000, 1e-3
TEMPERATURES = (30.0, 65.0, 100.0)


def read(signal: NDArray[np.float64], threshold: float) -> NDArray[np.float64]:
    """Reading of a sensor with a dead zone."""
    return np.asarray(np.sign(signal) * np.maximum(np.abs(signal) - threshold, 0.0))


def refitted(fit: Fit, candidate: Candidate) -> Fit:
    """Fit with a candidate added, from the best of its starts."""
    starts = [Start(values) for values in candidate.starts.T]
    return refitted_with(fit, candidate.term, starts)


def nominal_fit(seed: int, channel: Channel, share: float) -> tuple[Fit, float]:
    """Fit of the nominal model, and the threshold of the sensor [A, rad/s].

    The threshold is a share of the rated value.  The simulator of the benches shares no code with
    the model.
    """
    rng = np.random.default_rng(seed)
    motor = drawn_motor(rng)
    time = INTERVAL * np.arange(ROWS, dtype=np.float64)
    rated = motor.rated_current if channel == "current" else motor.rated_speed
    thresholds = [share * rated if channel == name else 0.0 for name in ("current", "speed")]
    runs: list[Run] = []
    for number, degrees in enumerate(TEMPERATURES):
        command = voltages(motor, time, number, False, rng)
        warm = np.full(ROWS, degrees)
        hidden, drive = Hidden(), Drive(motor.rated_voltage)
        true = simulated(motor, hidden, drive, time, command, warm, np.zeros(ROWS), 0.0)
        current, speed = read(true.current, thresholds[0]), read(true.speed, thresholds[1])
        current = current + 0.004 * motor.rated_current * rng.standard_normal(ROWS)
        speed = speed + 0.003 * motor.rated_speed * rng.standard_normal(ROWS)
        runs.append(Run(f"run{number}.csv", "0" * 64, time, true.command, current, speed, warm))
    return fit_declared(records_of(runs), "zoh"), max(thresholds)


@pytest.mark.parametrize("channel", ["current", "speed"])
def test_a_dead_zone_has_its_width_and_gains_most(channel: Channel) -> None:
    """The sensor loses 4 % of the rated value; the residual is then the noise of the sensor."""
    fit, threshold = nominal_fit(3, channel, 0.04)
    found = [refitted(fit, one) for one in SensorDeadZone.candidates(scales_of(fit))]
    best = min(found, key=lambda one: one.cost)

    (term,) = effects_of(best.simulator.model.terms)
    assert isinstance(term, SensorDeadZone)
    assert term.channel == channel
    assert best.by_name["unlisted.threshold"] == pytest.approx(threshold, rel=0.02)


def test_a_sensor_without_a_dead_zone_gets_none() -> None:
    """The gain in log likelihood of one parameter is below 5 in 999 of 1,000 cases."""
    fit, _ = nominal_fit(4, "current", 0.0)

    for one in SensorDeadZone.candidates(scales_of(fit)):
        assert fit.cost - refitted(fit, one).cost < 5.0


def test_a_dead_zone_comes_back_from_a_result() -> None:
    """Its settings restore it, as for each unlisted term."""
    term = SensorDeadZone("speed", 100.0)

    entry = {"name": "unlisted", "equation": "sensor", "settings": term.settings}
    assert term_of(entry) == term
