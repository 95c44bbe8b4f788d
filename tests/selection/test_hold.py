"""Holds of the voltage: their scores, and a voltage that is logged one row late."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.effects_page import example_scales
from identification import FitOptions, identify
from identification.effects.friction import CoulombFriction
from identification.effects.sensor import InputHold, LateVoltage
from identification.fit.declared import fit_declared
from identification.ingest.run import Run
from identification.model.composite import Hold, MotorModel
from identification.model.excitation import records_of
from identification.model.simulate import Simulator, initial_states
from identification.selection.score import with_fitted_hold
from identification.selection.screen import screened
from tests.motors import campaign, motor_named, simulated

SLOW = np.array([0.6, 0.0039, 0.07, -0.0012, 4e-4, 1e-3, 6e-5])
"""Time constants of 0.1 and 50 ms."""


def stepped(name: str, levels: tuple[float, ...], seed: int) -> Run:
    """Steps at 5 ms a sample, with noise, of a loop that sets, waits and logs the voltage."""
    voltage = np.repeat(levels, 100)
    body = np.full(voltage.size, 25.0)
    exact = simulated(SLOW, 5e-3, voltage, body, np.zeros(2))
    noise = np.random.default_rng(seed).standard_normal((voltage.size, 2)) * [0.02, 0.3]
    current, speed = (exact + noise).T
    time = 5e-3 * np.arange(voltage.size, dtype=np.float64)
    return Run(
        name,
        f"{seed:064d}",
        time,
        np.concatenate([voltage[:1], voltage[:-1]]),
        current,
        speed,
        body,
    )


@pytest.mark.parametrize("hold", ["zoh", "foh"])
@pytest.mark.parametrize("friction", [(), (0.02, 0.0)])
def test_a_late_voltage_simulates_as_the_voltage_one_row_earlier(
    hold: Hold, friction: tuple[float, ...]
) -> None:
    """Reference: zero-order hold of the shifted column, linear and in substeps."""
    run = stepped("a.csv", (0.0, 12.0, -6.0), 1)
    early = replace(run, voltage=np.concatenate([run.voltage[1:], run.voltage[-1:]]))
    late, held = records_of([run]), records_of([early])
    terms = (CoulombFriction.candidates(example_scales())[0].term,) if friction else ()
    values = np.concatenate([SLOW, friction])

    reference = Simulator.fitting(MotorModel(terms), held, values)
    simulator = Simulator.fitting(MotorModel((*terms, LateVoltage()), hold), late, values)
    states = [initial_states(reference.model, record) for record in held]

    expected = reference.logged(values[:, None], states)[0]
    found = simulator.logged(values[:, None], states)[0]
    np.testing.assert_allclose(found, expected, rtol=1e-7, atol=1e-7)


def test_a_voltage_that_is_logged_one_row_late_is_identified() -> None:
    """The usual loop of a microcontroller; the parameters are those of the motor."""
    runs = [stepped("a.csv", (0.0, 12.0, 6.0), 1), stepped("b.csv", (0.0, 6.0, 12.0), 2)]

    result = identify(runs[:1], runs[1:], FitOptions(posterior=False)).result

    found = [(effect["name"], effect["variant"]) for effect in result["effects"]]
    assert found == [("input_hold", LateVoltage.law)]
    for name, true in (("Ra25", 0.6), ("Kt25", 0.07), ("J", 4e-4), ("b", 1e-3)):
        value = result["parameters"][name]
        width = value["q95"] - value["q05"]
        assert value["identified"]
        assert abs(value["median"] - true) < max(width, 0.01 * true)
        assert width < 0.1 * true


def test_the_gain_of_another_hold_is_that_of_a_fit() -> None:
    """A motor driven by slow waves: the prediction misses most of the gain, the fit none."""
    motor = motor_named("servo 100 W")
    records = records_of(campaign(motor, seed=4, kind="multisine", hold="foh"))
    held, ramped = (fit_declared(records, hold) for hold in ("zoh", "foh"))
    (predicted,) = screened(held, InputHold.candidates(None)[:1])  # type: ignore[arg-type]
    (fitted,) = with_fitted_hold(held, [predicted])
    assert predicted.gain < 0.8 * fitted.gain
    assert fitted.gain == pytest.approx(held.cost - ramped.cost)
    assert fitted.starts[0].along is not None


def test_a_fit_of_the_wrong_hold_changes_no_prediction() -> None:
    """A motor driven by held steps: the other hold fits worse, and its score stays."""
    motor = motor_named("servo 100 W")
    held = fit_declared(records_of(campaign(motor, seed=4)), "zoh")
    predicted = screened(held, InputHold.candidates(None))  # type: ignore[arg-type]
    assert with_fitted_hold(held, predicted) == predicted
