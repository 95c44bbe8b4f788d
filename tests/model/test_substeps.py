"""Substeps of sample intervals: selection, and invariance of the results."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identification.effects.friction import CoulombFriction
from identification.effects.periodic import CoggingTorque
from identification.effects.sensor import ChannelDelay
from identification.model.composite import INPUTS, Hold, MotorModel
from identification.model.excitation import records_of
from identification.model.simulate import Simulator
from identification.model.substeps import MOST_SUBSTEPS, Substeps, divided, doublings, evenly
from identification.model.weighting import Weighting
from tests.model.unequal import unequal
from tests.motors import drive, driven, motor_named, run_of

SERVO = motor_named("servo 100 W")
ROWS = 400
START = np.array([1.0, 50.0])


@pytest.mark.parametrize("hold", ["zoh", "foh"])
def test_substeps_of_a_linear_motor_change_nothing(hold: Hold) -> None:
    """The flow over an interval is the composition of the flows over its substeps."""
    records = tuple(records_of([driven(SERVO, ROWS, seed=1, warming=0.0)]))
    whole = Simulator.fitting(MotorModel(hold=hold), records, SERVO.vector)
    parts = replace(whole, substeps=(unequal(ROWS, 1),))

    expected = whole.logged(SERVO.vector[:, None], [START])[0]
    found = parts.logged(SERVO.vector[:, None], [START])[0]

    np.testing.assert_allclose(found, expected, rtol=1e-7, atol=1e-7)


def test_the_misfit_counts_samples_and_not_substeps() -> None:
    """The sums of squares are those of the samples alone, also for coloured noise."""
    records = tuple(records_of([driven(SERVO, ROWS, seed=2, warming=0.0)]))
    whole = Simulator.fitting(MotorModel(hold="foh"), records, SERVO.vector)
    parts = replace(whole, substeps=(unequal(ROWS, 2),))
    weighting = replace(
        Weighting.white(records), whitening=(np.array([1.0, -0.4]), np.array([1.0, -0.2, 0.1]))
    )
    values = 1.05 * SERVO.vector[:, None]

    expected = whole.misfit(values, [START], weighting)
    found = parts.misfit(values, [START], weighting)

    np.testing.assert_allclose(found, expected, rtol=1e-6)


@pytest.mark.parametrize("channel", ["current", "speed", "voltage"])
def test_a_delay_does_not_depend_on_the_substeps(channel: str) -> None:
    """Substeps are not samples: the channel lags by the same time."""
    records = tuple(records_of([driven(SERVO, ROWS, seed=3, warming=0.0)]))
    model = MotorModel(hold="foh").adding(ChannelDelay(channel, 4, SERVO.interval))
    values = np.append(SERVO.vector, 1.3 * SERVO.interval)
    whole = Simulator.fitting(model, records, values)
    parts = replace(whole, substeps=(unequal(ROWS, 3),))

    expected = whole.logged(values[:, None], [START])[0]
    found = parts.logged(values[:, None], [START])[0]

    np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-6)


def test_only_reversals_are_divided_for_dry_friction() -> None:
    """The friction torque changes sign at standstill, so only intervals near it need substeps."""
    records = tuple(records_of([driven(SERVO, ROWS, seed=4, warming=0.0)]))
    rated = SERVO.voltage / SERVO.values[2]
    model = MotorModel(hold="foh").adding(CoulombFriction(0.1, 3e-3 * rated))
    values = np.concatenate([SERVO.vector, [0.05 * SERVO.values[2], 0.0]])
    simulator = Simulator.fitting(model, records, values)

    fine = simulator.with_tolerance(values, [START], np.array([1e-3, 1e-5 * rated]))

    assert fine.substeps is not None
    speed = simulator.logged(values[:, None], [START])[0][:, 1, 0]
    many = np.flatnonzero(fine.substeps[0].counts > 1)
    assert many.size
    assert np.abs(speed[many]).max() < 0.3 * np.abs(speed).max()
    assert fine.substeps[0].counts.mean() < 2.0


def test_substeps_converge_to_the_finest_division() -> None:
    """Reference: every interval divided into the largest number of substeps."""
    records = tuple(records_of([driven(SERVO, ROWS, seed=5, warming=0.0)]))
    rated = SERVO.voltage / SERVO.values[2]
    model = MotorModel(hold="foh").adding(CoulombFriction(0.1, 3e-3 * rated))
    values = np.concatenate([SERVO.vector, [0.05 * SERVO.values[2], 0.0]])
    simulator = Simulator.fitting(model, records, values)
    exact = replace(simulator, substeps=evenly([ROWS], MOST_SUBSTEPS))
    reference = exact.logged(values[:, None], [START])[0]

    def error(share: float) -> float:
        fine = simulator.with_tolerance(values, [START], share * np.array([1e-2, 1e-3 * rated]))
        return float(np.abs(fine.logged(values[:, None], [START])[0] - reference)[:, 1].max())

    assert error(1e-4) < 0.03 * error(10.0)
    assert error(1e-3) < 1e-4 * rated


@pytest.mark.parametrize("share", [1e-3, 1e-4])
def test_the_error_is_at_most_one_tolerance_for_each_divided_interval(share: float) -> None:
    """Each interval keeps its tolerance, and friction lets no error grow.

    Reference: every interval divided into sixteen times the largest number of substeps.
    """
    records = tuple(records_of([driven(SERVO, ROWS, seed=5, warming=0.0)]))
    rated = SERVO.voltage / SERVO.values[2]
    model = MotorModel(hold="foh").adding(CoulombFriction(0.1, 3e-3 * rated))
    values = np.concatenate([SERVO.vector, [0.05 * SERVO.values[2], 0.0]])
    simulator = Simulator.fitting(model, records, values)
    exact = replace(simulator, substeps=evenly([ROWS], 16 * MOST_SUBSTEPS))
    reference = exact.logged(values[:, None], [START])[0]
    tolerance = share * np.array([1e-2, 1e-3 * rated])

    fine = simulator.with_tolerance(values, [START], tolerance)

    assert fine.substeps is not None
    divisions = int(np.sum(fine.substeps[0].counts > 1))
    error = np.abs(fine.logged(values[:, None], [START])[0] - reference)[:, :, 0].max(axis=0)
    whole = np.abs(simulator.logged(values[:, None], [START])[0] - reference)[:, 1].max()
    assert error[1] < divisions * tolerance[1] < whole


def test_an_interval_is_divided_while_the_sum_of_its_errors_exceeds_its_tolerance() -> None:
    """By the inequality of the docstring, for any distribution of the error over the substeps."""
    rng = np.random.default_rng(8)
    substeps = Substeps.even(rng.integers(1, 9, 2000))
    errors = np.exp(3.0 * rng.standard_normal((substeps.rows, 2)) - 3.0)

    times = doublings(substeps, errors, np.ones(2))

    largest = errors.max(axis=1)
    sums = np.add.reduceat(largest, substeps.first_rows)
    tops = largest == np.repeat(np.maximum.reduceat(largest, substeps.first_rows), substeps.counts)
    np.testing.assert_array_equal(times[tops] > 0, sums > 1.0)
    assert 0.2 < np.mean(sums > 1.0) < 0.8
    assert np.all(times[np.repeat(sums <= 1.0, substeps.counts)] == 0)


def test_only_the_part_of_an_interval_around_a_reversal_is_divided() -> None:
    """Equal substeps, as short as the shortest ones, are twice as many and hardly more accurate."""
    records = tuple(records_of([driven(SERVO, ROWS, seed=5, warming=0.0)]))
    rated = SERVO.voltage / SERVO.values[2]
    model = MotorModel(hold="foh").adding(CoulombFriction(0.1, 3e-4 * rated))
    values = np.concatenate([SERVO.vector, [0.05 * SERVO.values[2], 0.0]])
    simulator = Simulator.fitting(model, records, values)
    fine = simulator.with_tolerance(values, [START], np.array([1e-6, 1e-7 * rated]))
    assert fine.substeps is not None
    (found,) = fine.substeps
    shortest = np.minimum.reduceat(found.shares, found.first_rows)
    equal = Substeps.even(np.rint(1.0 / shortest).astype(np.int64))
    exact = replace(simulator, substeps=evenly([ROWS], 16 * MOST_SUBSTEPS))
    reference = exact.logged(values[:, None], [START])[0]

    def error(substeps: Substeps) -> float:
        one = replace(simulator, substeps=(substeps,))
        return float(np.abs(one.logged(values[:, None], [START])[0] - reference)[:, 1].max())

    assert found.rows - ROWS < 0.5 * (equal.rows - ROWS)
    assert error(found) < 1.5 * error(equal)


def test_a_converged_simulation_is_within_a_millionth_of_the_signals() -> None:
    """Reference: sixteen times as many substeps as a fit may use, in every interval."""
    records = tuple(records_of([driven(SERVO, ROWS, seed=5, warming=0.0)]))
    rated = SERVO.voltage / SERVO.values[2]
    model = MotorModel(hold="foh").adding(CoulombFriction(0.1, 3e-3 * rated))
    values = np.concatenate([SERVO.vector, [0.05 * SERVO.values[2], 0.0]])
    simulator = Simulator.fitting(model, records, values)
    exact = replace(simulator, substeps=evenly([ROWS], 16 * MOST_SUBSTEPS))

    found, reference = (
        one.logged(values[:, None], [START])[0][:, :, 0]
        for one in (simulator.converged(values, [START]), exact)
    )

    assert np.all(np.abs(found - reference).max(axis=0) < 1e-6 * np.ptp(reference, axis=0))


def test_a_shaft_that_almost_stops_between_teeth_is_simulated_to_a_millionth() -> None:
    """It amplifies the errors of all intervals before; reference: a ten times smaller tolerance."""
    voltage = 0.2 * drive(SERVO, "steps", 600, np.random.default_rng(19))
    records = tuple(records_of([run_of(SERVO, voltage, np.full(600, 25.0), START)]))
    cogging = CoggingTorque(0.1, logged=False, angle="simulated")
    values = np.append(SERVO.vector, 14.0)
    start = np.array([2.0, 60.0, 0.05, 0.015, 0.01, 0.005, 0.0])
    simulator = Simulator.fitting(MotorModel().adding(cogging), records, values)
    coarse = simulator.converged(values, [start])
    fine = coarse.with_tolerance(values, [start], 3e-10 * records[0].span, most=4096)

    found, reference = (one.logged(values[:, None], [start])[0][:, :, 0] for one in (coarse, fine))

    assert np.all(np.abs(found - reference).max(axis=0) < 1e-6 * np.abs(reference).max(axis=0))


def test_divided_inputs_cover_the_interval() -> None:
    """Lengths add up to the interval, and each substep begins where the previous one ended."""
    record = records_of([driven(SERVO, 10, seed=6, warming=20.0)])[0]
    substeps = Substeps.even(np.array([1, 3, 2, 1, 4, 1, 1, 2, 1, 1]))
    substeps = substeps.halved(np.random.default_rng(6).integers(0, 4, substeps.rows))

    rows = divided(record.inputs, substeps, "foh")

    column = {name: k for k, name in enumerate(INPUTS)}
    summed = np.add.reduceat(rows[:, column["interval"]], substeps.first_rows)
    np.testing.assert_allclose(summed, record.inputs[:, column["interval"]], rtol=1e-12)
    inside = rows[1:, column["substep"]] > 0
    for name in ("voltage", "temperature", "angle"):
        ends, starts = rows[:-1, column[f"{name}_next"]], rows[1:, column[name]]
        np.testing.assert_allclose(ends[inside], starts[inside], rtol=1e-12)


def test_a_substep_that_is_not_finite_is_divided_up_to_the_limit() -> None:
    """Bound as documented: at most `MOST_SUBSTEPS`."""
    substeps = Substeps.even(np.array([1, 32, 64]))

    times = doublings(substeps, np.full((97, 2), np.nan), np.ones(2))

    assert list(np.add.reduceat(2**times, substeps.first_rows)) == [8, MOST_SUBSTEPS, MOST_SUBSTEPS]
