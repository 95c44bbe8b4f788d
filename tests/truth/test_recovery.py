"""Recovery of known motors from their runs, for all sizes and benches."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import pytest
from numpy.typing import NDArray

from identification.fit.declared import fit_declared
from identification.fit.evaluate import simulate_fitted, simulate_unseen
from identification.fit.solve import Fit
from identification.ingest.run import Run
from identification.model.excitation import records_of
from tests.motors import Excitation, Motor, campaign, motor_named, noiseless

Array = NDArray[np.float64]
Hold = Literal["zoh", "foh"]


@dataclass(frozen=True)
class Bench:
    """Drive and logging of a motor of the table."""

    motor: str
    kind: Excitation
    noise: float
    hold: Hold = "zoh"
    moving: bool = False
    runs: int = 3
    rows: int = 1500


BENCHES = (
    Bench("watch 1 W", "steps", 0.01),
    Bench("coreless 10 W", "forward", 0.003, moving=True),
    Bench("ferrite 50 W", "multisine", 0.03, hold="foh"),
    Bench("servo 100 W", "binary", 0.01, moving=True),
    Bench("servo 100 W", "steps", 0.02, runs=6, rows=400),
    Bench("samarium 400 W", "steps", 0.001, hold="foh"),
    Bench("paper", "steps", 0.01, moving=True),
    Bench("paper", "binary", 0.003, hold="foh"),
    Bench("pump 2 kW", "forward", 0.02),
    Bench("traction 10 kW", "multisine", 0.005, moving=True),
    Bench("traction 10 kW", "steps", 0.02),
)


def fitted(bench: Bench, seed: int) -> tuple[Fit, list[Run]]:
    """Fit of one campaign on a bench, and its runs."""
    runs = campaign(
        motor_named(bench.motor),
        seed=seed,
        noise=bench.noise,
        runs=bench.runs,
        rows=bench.rows,
        kind=bench.kind,
        hold=bench.hold,
        moving=bench.moving,
    )
    return fit_declared(records_of(runs), bench.hold), runs


def deviations(fit: Fit, truth: Array) -> Array:
    """(7,) error of the search coordinates in standard deviations of the fit."""
    sd = np.sqrt(np.diag(fit.equations.covariance()))
    return np.asarray((fit.position - fit.coordinates.of(truth)) / sd)


@pytest.mark.parametrize("bench", BENCHES, ids=lambda bench: f"{bench.motor}, {bench.kind}")
def test_a_motor_is_identified_from_its_runs_alone(bench: Bench) -> None:
    """True values are the table's; 77 normal deviates exceed 4 with a probability of 1/200."""
    motor = motor_named(bench.motor)

    fit, _ = fitted(bench, seed=11)

    assert fit.converged
    assert np.abs(deviations(fit, motor.vector)).max() < 4.0


@pytest.mark.parametrize("ratio", [5.0, 10.0])
def test_a_winding_faster_than_the_sampling_is_found_from_a_slow_start(ratio: float) -> None:
    """The starting value of L/R is several times too large, so the step plan must adapt."""
    servo = motor_named("servo 100 W")
    inductance = servo.values[0] * servo.interval / ratio
    motor = Motor("fast", (*servo.values[:6], inductance), servo.voltage, servo.interval)

    fit = fit_declared(records_of(campaign(motor, seed=61, noise=0.002, rows=2500)), "zoh")

    assert fit.converged
    assert np.abs(deviations(fit, motor.vector)).max() < 4.0
    assert fit.simulator.plan.rate > 1.2 * ratio


@pytest.mark.parametrize("bench", BENCHES[2:4], ids=lambda bench: bench.motor)
def test_the_noise_is_estimated_with_the_motor(bench: Bench) -> None:
    """The true noise is `bench.noise` of each channel; 4500 samples estimate it to 1.1 %."""
    motor = motor_named(bench.motor)
    clean = noiseless(motor, seed=11, kind=bench.kind, hold=bench.hold, moving=bench.moving)
    channels = [
        np.concatenate([run.current for run in clean]),
        np.concatenate([run.speed for run in clean]),
    ]

    fit, _ = fitted(bench, seed=11)

    expected = bench.noise * np.array([np.std(channel) for channel in channels])
    np.testing.assert_allclose(fit.weighting.deviation, expected, rtol=0.045)


def test_deviations_from_the_truth_agree_with_the_covariance() -> None:
    """70 squared deviates of mean 1 have a mean of 1 within 0.17; three times that is allowed."""
    motor = motor_named("servo 100 W")
    squares = []
    for seed in range(10):
        bench = Bench("servo 100 W", "steps", 0.02, runs=2, rows=500)
        fit, _ = fitted(bench, seed=100 + seed)
        squares.append(deviations(fit, motor.vector) ** 2)

    assert np.mean(squares) == pytest.approx(1.0, abs=0.51)


def test_without_noise_the_truth_itself_is_found() -> None:
    """Without noise, only the tolerance of the discretisation remains."""
    motor = motor_named("servo 100 W")

    fit = fit_declared(records_of(noiseless(motor, seed=3, kind="steps")), "zoh")

    np.testing.assert_allclose(fit.values, motor.values, rtol=1e-3)


@pytest.mark.parametrize("hold", ["zoh", "foh"])
@pytest.mark.parametrize("name", ["servo 100 W", "traction 10 kW"])
def test_the_data_determine_the_hold_of_the_voltage(name: str, hold: Hold) -> None:
    """The true hold has the lower cost by far more than chance (ten nats)."""
    runs = campaign(motor_named(name), seed=21, hold=hold, kind="steps")
    other: Hold = "foh" if hold == "zoh" else "zoh"

    right = fit_declared(records_of(runs), hold)
    wrong = fit_declared(records_of(runs), other)

    assert right.cost < wrong.cost - 10.0


def test_validation_runs_are_predicted_to_the_noise_level() -> None:
    """A perfect model leaves the noise, which 1500 samples estimate to 2 %."""
    motor = motor_named("servo 100 W")
    fit, _ = fitted(Bench("servo 100 W", "steps", 0.01), seed=31)
    unseen = campaign(motor, seed=32, noise=0.01, runs=1, moving=True)
    truth = noiseless(motor, seed=32, runs=1, moving=True)[0]

    (simulated,) = simulate_unseen(fit, records_of(unseen, first=3))

    noise = 0.01 * np.array([np.std(truth.current), np.std(truth.speed)])
    rms = np.sqrt(np.mean(simulated.residual**2, axis=0))
    np.testing.assert_allclose(rms, noise, rtol=0.08)


def test_the_simulation_of_a_fit_is_the_motor_without_its_noise() -> None:
    """The noise-free run is known; 14 parameters and states of 4500 samples leave 6 % of noise."""
    motor = motor_named("paper")
    clean = noiseless(motor, seed=11, moving=True)

    fit, _ = fitted(Bench("paper", "steps", 0.01, moving=True), seed=11)

    for run, simulated in zip(clean, simulate_fitted(fit), strict=True):
        error = simulated.logged - np.column_stack([run.current, run.speed])
        assert np.all(np.sqrt(np.mean(error**2, axis=0)) < 0.2 * fit.weighting.deviation)


def scaled(runs: list[Run], volts: float, amperes: float, seconds: float) -> list[Run]:
    """The same runs in other units of voltage, current and time; the angle keeps its unit."""
    return [
        replace(
            run,
            time=run.time * seconds,
            voltage=run.voltage * volts,
            current=run.current * amperes,
            speed=run.speed / seconds,
        )
        for run in runs
    ]


@pytest.mark.parametrize(
    "factors", [(10.0, 1.0, 1.0), (1.0, 1e3, 1.0), (1.0, 1.0, 0.01), (0.1, 20.0, 5.0)]
)
def test_other_units_of_the_data_scale_the_motor_and_nothing_else(
    factors: tuple[float, float, float],
) -> None:
    """Dimensions: Ra ~ V/A, Kt ~ Vs, L ~ Vs/A, b ~ V A s^2, J ~ V A s^3, coefficients ~ 1."""
    volts, amperes, seconds = factors
    runs = campaign(motor_named("servo 100 W"), seed=41, noise=0.01, rows=800)
    plain = fit_declared(records_of(runs), "zoh")

    fit = fit_declared(records_of(scaled(runs, volts, amperes, seconds)), "zoh")

    ratios = np.array(
        [
            volts / amperes,
            1.0,
            volts * seconds,
            1.0,
            volts * amperes * seconds**3,
            volts * amperes * seconds**2,
            volts * seconds / amperes,
        ]
    )
    sd = np.sqrt(np.diag(plain.equations.covariance())) * plain.coordinates.slopes(plain.position)
    # The iterations stop once a step is far below the uncertainty, not at the same digit.
    np.testing.assert_array_less(np.abs(fit.values / ratios - plain.values), 0.02 * sd)


def test_a_motor_wired_the_other_way_round_is_the_same_motor() -> None:
    """The equations are invariant when voltage, current and speed change sign."""
    runs = campaign(motor_named("paper"), seed=51, rows=800)
    reversed_runs = [
        replace(run, voltage=-run.voltage, current=-run.current, speed=-run.speed) for run in runs
    ]
    plain = fit_declared(records_of(runs), "zoh")

    fit = fit_declared(records_of(reversed_runs), "zoh")

    np.testing.assert_allclose(fit.values, plain.values, rtol=1e-4)
