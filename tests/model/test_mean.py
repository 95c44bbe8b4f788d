"""Speed logged as its mean over the sample interval, as from encoder counts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from bench import EffectRequest, Noise, make_campaign
from identification.effects.average import CurrentMean, SpeedAverage, SpeedMean, SpeedRecursion
from identification.effects.sensor import ChannelDelay, SpeedFilter
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
from tests.model.denser import densely
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


def current(simulator: Simulator) -> np.ndarray:
    """Logged current of the servo [A]."""
    return simulator.logged(SERVO.vector[:, None], [START])[0][:, 0, 0]


@pytest.mark.parametrize(
    ("law", "logged", "digits"), [(SpeedMean(), speed, 1e-7), (CurrentMean(), current, 1e-5)]
)
def test_mean_is_the_integral_over_the_interval(
    law: AbstractTerm, logged: Callable[[Simulator], np.ndarray], digits: float
) -> None:
    """Reference: Simpson's rule on 64 substeps; the trapezoid over whole intervals errs by 0.6."""
    dense = densely(RECORDS[0], FINE)
    true = logged(Simulator.fitting(DECLARED, [dense], SERVO.vector))
    mean = logged(Simulator.fitting(DECLARED.adding(law), RECORDS, SERVO.vector))
    within = np.stack([true[k : -FINE - 1 + k or None : FINE] for k in range(FINE + 1)])
    weights = np.ones(FINE + 1)
    weights[1:-1:2], weights[2:-1:2] = 4.0, 2.0

    expected = weights @ within / (3 * FINE)

    np.testing.assert_allclose(mean[1 : 1 + expected.size], expected, atol=digits)
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
    assert "mean" in printed_equations(MEAN.model)["speed average"]


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


@pytest.mark.parametrize("window", [1.25, 2.0, 3.5, 8.0])
def test_a_moving_average_is_the_mean_of_the_integral_over_its_window(window: float) -> None:
    """Reference: the integral of the speed of a log that is 64 times denser."""
    times = FINE * np.arange(ROWS)
    dense = speed(Simulator.fitting(DECLARED, [densely(RECORDS[0], FINE)], SERVO.vector))
    integral = np.concatenate([[0.0], np.cumsum(0.5 * (dense[1:] + dense[:-1]))])
    back = round(window * FINE)
    expected = (integral[times[10:]] - integral[times[10:] - back]) / back

    model = DECLARED.adding(SpeedAverage(SERVO.interval))
    values = np.append(SERVO.vector, window * SERVO.interval / 2)
    found = speed(Simulator.fitting(model, RECORDS, values), values[-1])

    exactly = 1e-5 if window == round(window) else 2e-3
    np.testing.assert_allclose(found[10:], expected, atol=exactly * np.abs(expected).max())
    late = DECLARED.adding(ChannelDelay("speed", 4, SERVO.interval), SpeedAverage(SERVO.interval))
    delayed = Simulator.fitting(late, RECORDS, np.insert(values, -1, 2.0 * SERVO.interval))
    lagging = speed(delayed, 2.0 * SERVO.interval, values[-1])
    np.testing.assert_allclose(lagging[12:], found[10:-2], atol=1e-9 * np.abs(expected).max())


@pytest.mark.parametrize("share", [0.5, 3.0])
def test_a_recursive_filter_is_that_of_the_samples(share: float) -> None:
    """y_k = a y_(k-1) + (1 - a) x_k from the first sample on, also of a delayed channel."""
    delay = ChannelDelay("speed", 4, SERVO.interval)
    kept = np.exp(-1.0 / share)
    for terms, own in (((), ()), ((delay,), (1.3 * SERVO.interval,))):
        plain = DECLARED.adding(*terms)
        values = np.append(SERVO.vector, own)
        samples = speed(Simulator.fitting(plain, RECORDS, values), *own)
        expected = [RECORDS[0].measured[0, 1]]
        for sample in samples:
            expected.append(kept * expected[-1] + (1.0 - kept) * sample)

        model = plain.adding(SpeedRecursion(SERVO.interval))
        values = np.append(values, share * SERVO.interval)
        found = speed(Simulator.fitting(model, RECORDS, values), *own, values[-1])

        np.testing.assert_allclose(found, expected[1:], atol=1e-9 * np.abs(found).max())
