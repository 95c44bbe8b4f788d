"""Low-pass filters of the logged voltage: their inverse, and a motor behind one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from benchmarks.effects_page import example_scales
from identification import FitOptions, identify
from identification.effects.effect import AbstractEffect
from identification.effects.friction import CoulombFriction
from identification.effects.voltage_filter import DigitalVoltageFilter, VoltageFilter
from identification.ingest.run import Run
from identification.model.composite import Hold, MotorModel
from identification.model.excitation import records_of
from identification.model.simulate import Simulator, initial_states
from tests.motors import simulated

MOTOR = np.array([0.6, 0.0039, 0.07, -0.0012, 4e-4, 1e-3, 1.2e-3])
"""Time constants of 2 and 50 ms."""
INTERVAL, LAG = 1e-3, 2.5e-3
SCALES = example_scales()
ANALOGUE, DIGITAL = VoltageFilter(3e-4, 0.3), DigitalVoltageFilter(3e-4, 0.3)
LAWS = pytest.mark.parametrize("law", [ANALOGUE, DIGITAL], ids=["analogue", "digital"])


def filtered(voltage: NDArray[np.float64], law: AbstractEffect) -> NDArray[np.float64]:
    """The log of a voltage (n_sample,) that is held from sample to sample, at rest before."""
    kept, output, logged = np.exp(-INTERVAL / LAG), 0.0, []
    for applied in voltage:
        following = kept * output + (1.0 - kept) * applied
        logged.append(output if law is ANALOGUE else following)
        output = following
    return np.array(logged)


def stepped(name: str, seed: int, law: AbstractEffect) -> tuple[Run, Run]:
    """A run of random steps from rest, and the same with the filtered voltage."""
    rng = np.random.default_rng(seed)
    voltage = np.repeat(rng.uniform(-12.0, 12.0, 100), 20)
    voltage[:20] = 0.0
    body = np.full(voltage.size, 25.0)
    exact = simulated(MOTOR, INTERVAL, voltage, body, np.zeros(2))
    current, speed = (exact + rng.standard_normal(exact.shape) * [0.02, 0.3]).T
    time = INTERVAL * np.arange(voltage.size, dtype=np.float64)
    run = Run(name, f"{seed:064d}", time, voltage, current, speed, body)
    return run, replace(run, voltage=filtered(voltage, law))


@LAWS
@pytest.mark.parametrize("hold", ["zoh", "foh"])
@pytest.mark.parametrize("has_friction", [False, True])
def test_a_filtered_log_simulates_as_the_voltage_at_the_terminals(
    law: AbstractEffect, hold: Hold, *, has_friction: bool
) -> None:
    """Reference: the held voltage itself, linear and with a friction that needs substeps."""
    run, logged = stepped("a.csv", 1, law)
    terms = (CoulombFriction.candidates(SCALES)[0].term,) if has_friction else ()
    values = np.concatenate([MOTOR, (0.02, 0.0) if has_friction else ()])
    plain = Simulator.fitting(MotorModel(terms), records_of([run]), values)
    model, own = MotorModel((*terms, law), hold), np.append(values, LAG)
    found = Simulator.fitting(model, records_of([logged]), own)
    states = [initial_states(plain.model, record) for record in plain.records]

    expected, returned = (
        each.converged(own[: each.model.symbols()[2].numel()], states).logged(
            own[: each.model.symbols()[2].numel(), None], states
        )[0]
        for each in (plain, found)
    )

    np.testing.assert_allclose(returned, expected, rtol=1e-6, atol=1e-6)


@LAWS
def test_a_filter_of_the_voltage_is_named_and_the_motor_is_right(law: AbstractEffect) -> None:
    """Without the effect, the inductance is far off: the current leads the logged voltage."""
    runs = [stepped(f"{seed}.csv", seed, law)[1] for seed in (1, 2, 3)]

    result = identify(runs[:2], runs[2:], FitOptions(posterior=False)).result

    assert [(one["name"], one["variant"]) for one in result["effects"]] == [
        ("voltage_filter", law.variant or None)
    ]
    found = result["effects"][0]["parameters"]["time_constant"]
    assert found["median"] == pytest.approx(LAG, rel=0.01)
    for row, name in enumerate(("Ra25", "Kt25", "J", "b", "L")):
        true = MOTOR[[0, 2, 4, 5, 6][row]]
        value = result["parameters"][name]
        assert value["identified"]
        assert abs(value["median"] - true) < value["q95"] - value["q05"]
        assert value["q95"] - value["q05"] < 0.05 * true


def test_a_voltage_that_jumps_between_two_samples_passed_no_filter() -> None:
    """The steps of one log last a sample; those of the other one continue behind its filter."""
    run, logged = stepped("a.csv", 1, ANALOGUE)

    jumping, smooth = (replace(SCALES, records=tuple(records_of([one]))) for one in (run, logged))

    assert VoltageFilter.is_excluded(jumping)
    assert not VoltageFilter.is_excluded(smooth)
