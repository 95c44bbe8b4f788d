"""Speed logged as its mean over the sample interval, as from encoder counts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bench import EffectRequest, Noise, make_campaign
from identification.effects.sensor import ChannelDelay, SpeedFilter, SpeedMean
from identification.fit.declared import fit_declared
from identification.model.composite import MotorModel
from identification.model.excitation import records_of
from identification.model.printing import printed_equations
from identification.model.simulate import Simulator
from identification.model.tangent import tangent
from identification.model.term import AbstractTerm
from identification.selection.candidates import scales_of
from identification.selection.refit import refitted_with
from identification.selection.screen import screened
from identification.surrogates.entry import term_of
from tests.effects.hidden import records_of_bench
from tests.model.unequal import unequal
from tests.motors import driven, motor_named

SERVO = motor_named("servo 100 W")
ROWS = 400
FINE = 64
START = np.array([0.0, 10.0])
DECLARED = MotorModel(hold="zoh")
RECORDS = tuple(records_of([driven(SERVO, ROWS, seed=3, warming=0.0)]))
MEAN = Simulator.fitting(DECLARED.adding(SpeedMean()), RECORDS, SERVO.vector)


def speed(simulator: Simulator, *more: float) -> np.ndarray:
    """Logged speed of the servo [rad/s]."""
    values = np.append(SERVO.vector, more)[:, None]
    return simulator.logged(values, [START])[0][:, 1, 0]


def test_mean_is_the_integral_of_the_speed_over_the_interval() -> None:
    """Reference: Simpson's rule on 64 substeps; the trapezoid over whole intervals errs by 0.6."""
    finely = records_of([driven(SERVO, ROWS, seed=3, warming=0.0)])[0]
    inputs = np.repeat(finely.inputs, FINE, axis=0)
    inputs[:, 0] /= FINE
    dense = replace(
        finely,
        time=np.concatenate([[0.0], np.cumsum(inputs[:-1, 0])]),
        inputs=inputs,
        measured=np.repeat(finely.measured, FINE, axis=0),
        weight=np.repeat(finely.weight, FINE, axis=0),
    )
    true = speed(Simulator.fitting(DECLARED, [dense], SERVO.vector))
    within = np.stack([true[k : -FINE - 1 + k or None : FINE] for k in range(FINE + 1)])
    weights = np.ones(FINE + 1)
    weights[1:-1:2], weights[2:-1:2] = 4.0, 2.0

    expected = weights @ within / (3 * FINE)

    np.testing.assert_allclose(speed(MEAN)[1 : 1 + expected.size], expected, atol=1e-7)
    trapezoid = 0.5 * (true[:-FINE:FINE] + true[FINE::FINE])
    assert np.abs(trapezoid[: expected.size] - expected).max() > 0.1


def test_mean_does_not_depend_on_the_substeps() -> None:
    """Substeps are not samples: the motor logs the same means."""
    found = speed(replace(MEAN, substeps=(unequal(ROWS, 3),)))

    np.testing.assert_allclose(found, speed(MEAN), atol=1e-8)


def test_a_delay_of_one_sample_logs_the_mean_before() -> None:
    """A mean delayed by one interval is the mean of the previous interval."""
    model = DECLARED.adding(ChannelDelay("speed", 4, SERVO.interval), SpeedMean())
    late = Simulator.fitting(model, RECORDS, np.append(SERVO.vector, SERVO.interval))

    found = speed(late, SERVO.interval)

    np.testing.assert_allclose(found[2:], speed(MEAN)[1:-1], atol=1e-9)


def test_derivatives_of_a_mean_are_those_of_its_simulation() -> None:
    """Reference: central differences of the simulated log."""
    step = 1e-5 * SERVO.vector
    directions = np.diag(SERVO.vector)[:, :3]
    _, tangents = tangent(MEAN, SERVO.vector, [START], directions)
    for k in range(3):
        moved = [SERVO.vector.copy() for _ in range(2)]
        moved[0][k] += step[k]
        moved[1][k] -= step[k]
        up, down = (MEAN.logged(v[:, None], [START])[0][:, 1, 0] for v in moved)
        np.testing.assert_allclose(tangents[0][:, 1, k], (up - down) / 2e-5, rtol=1e-4, atol=1e-2)


def test_first_sample_does_not_count_since_its_mean_began_before_the_record() -> None:
    """The first sample has no weight; the weights of the others are scaled to the same sum."""
    assert MEAN.model.edges == ((0, 0), (1, 0))
    assert MEAN.records[0].weight[0, 1] == 0.0
    assert MEAN.records[0].weight.sum() == pytest.approx(RECORDS[0].weight.sum())


@pytest.mark.parametrize(
    ("term", "settings"),
    [
        (SpeedMean(), {"law": "mean over the sample interval"}),
        (SpeedFilter(1e-4, 0.3, 2), {"fastest": 1e-4, "slowest": 0.3, "order": 2}),
    ],
)
def test_either_law_of_a_speed_filter_is_read_from_a_result(
    term: AbstractTerm, settings: dict[str, object]
) -> None:
    """The settings in a result are the fields of the law."""
    assert term_of({"name": "speed_filter", "settings": settings}) == term


def test_equations_name_the_mean_of_the_speed() -> None:
    """The equation is given in words because a mean is not a function of the state."""
    assert "mean" in printed_equations(MEAN.model)["speed channel"]


@pytest.mark.parametrize("motor", ["servo_150w", "ferrite_fan_30w"])
def test_differenced_angle_is_a_mean_and_reaches_the_noise(motor: str) -> None:
    """Law `difference` of size 0.05 spans one sample interval; the noise of the bench is known."""
    measured = make_campaign(
        motor,
        [EffectRequest("speed_filter", size=0.05, law="difference")],
        seed=7,
        rows=800,
        training=2,
        noise=Noise(kind="white"),
    )
    declared = fit_declared(records_of_bench(measured).training, "zoh")
    scales = scales_of(declared)
    kinds = (SpeedFilter, ChannelDelay)
    scores = screened(declared, [one for kind in kinds for one in kind.candidates(scales)])
    (score,) = (one for one in scores if isinstance(one.candidate.term, SpeedMean))

    fit = refitted_with(declared, score.candidate.final, list(score.starts))

    noise = np.array([measured.truth["noise"][n] for n in ("current_A", "speed_rad_s")])
    assert np.all(fit.weighting.deviation < 1.05 * noise)
    assert declared.weighting.deviation[1] > 1.2 * noise[1]
