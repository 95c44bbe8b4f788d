"""Conversion of runs to records: temperature smoothing, gaps, clipped samples, run order."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from identification.ingest.run import Run
from identification.model.composite import INPUTS
from identification.model.excitation import records_of
from identification.model.logged_temperature import smooth_temperature

Array = NDArray[np.float64]


def run_at(temperature: Array | None, rows: int = 2000, **others: object) -> Run:
    """Run of two seconds with the given temperature."""
    time = 0.001 * np.arange(rows, dtype=np.float64)
    waves = np.sin(20 * time)
    run = Run("run.csv", "0" * 64, time, 10 * waves, waves, 100 * waves, temperature)
    return replace(run, **others)  # type: ignore[arg-type]


def smoothed(run: Run) -> Array:
    """Smoothed temperature of a run (n_sample,) [degC]."""
    assert run.temperature is not None
    return smooth_temperature(run.time, run.temperature, run.segments)


@pytest.mark.parametrize("digit", [0.1, 0.5, 1.0])
def test_smoothing_removes_the_steps_of_the_logger(digit: float) -> None:
    """The error to the true curve is below half a logger step, and its rms below a tenth."""
    share = np.linspace(0.0, 1.0, 4000)
    truth = 25.0 + 40.0 * (1.0 - np.exp(-2.0 * share))
    rng = np.random.default_rng(1)
    logged = np.round((truth + 0.3 * digit * rng.standard_normal(4000)) / digit) * digit

    smooth = smoothed(run_at(logged, 4000))

    assert np.sqrt(np.mean((smooth - truth) ** 2)) < 0.1 * digit
    assert np.abs(smooth - truth).max() < 0.5 * digit


def test_a_clean_curve_is_kept() -> None:
    """Without noise or steps, the smoothed temperature equals the logged one."""
    truth = 60.0 + 10.0 * np.sin(np.linspace(0.0, 3.0, 3000))

    smooth = smoothed(run_at(truth, 3000))

    np.testing.assert_allclose(smooth, truth, atol=0.02)


@pytest.mark.parametrize("temperature", [-20.0, 25.0, 113.5])
def test_a_constant_temperature_is_unchanged(temperature: float) -> None:
    """The smooth curve through a constant is the constant."""
    smooth = smoothed(run_at(np.full(2000, temperature)))

    np.testing.assert_allclose(smooth, temperature, rtol=1e-12)


def test_a_run_of_a_few_samples_is_interpolated() -> None:
    """Fewer than eight samples do not support a spline, so their values are used."""
    smooth = smoothed(run_at(np.array([30.0, 31.0, 32.0]), 3))

    np.testing.assert_allclose(smooth, [30.0, 31.0, 32.0])


def test_a_record_holds_the_run_in_the_order_of_the_inputs() -> None:
    """Each column contains the named signal; the last interval has zero length."""
    run = run_at(np.full(2000, 40.0))

    (record,) = records_of([run])

    assert record.inputs.shape == (2000, len(INPUTS))
    np.testing.assert_allclose(record.column("interval")[:-1], 0.001)
    assert record.column("interval")[-1] == 0.0
    np.testing.assert_array_equal(record.column("voltage"), run.voltage)
    np.testing.assert_array_equal(record.column("voltage_next")[:-1], run.voltage[1:])
    np.testing.assert_array_equal(record.measured, np.column_stack([run.current, run.speed]))
    np.testing.assert_array_equal(record.weight, np.ones((2000, 2)))


def test_a_gap_splits_a_run_into_records_with_their_own_start() -> None:
    """Segments are half-open ranges of the run; no interval spans the gap between them."""
    run = run_at(np.full(2000, 40.0), segments=((0, 700), (700, 1500), (1500, 2000)))
    late = replace(run, time=run.time + 3.0 * (np.arange(2000) >= 700))

    records = records_of([late])

    assert [(record.start, record.rows) for record in records] == [
        (0, 700),
        (700, 800),
        (1500, 500),
    ]
    assert {record.run for record in records} == {0}
    for record in records:
        assert record.column("interval").max() == pytest.approx(0.001)
        assert record.column("interval")[-1] == 0.0
    assert records[1].time[0] == pytest.approx(3.7)


def test_a_segment_of_one_sample_is_no_record() -> None:
    """One sample contains no motion."""
    run = run_at(np.full(2000, 40.0), segments=((0, 1), (1, 2000)))

    assert [record.rows for record in records_of([run])] == [1999]


def test_the_peak_temperature_is_carried_from_run_to_run() -> None:
    """Reference: running maximum over the runs in the order of recording."""
    runs = [run_at(np.linspace(a, b, 2000)) for a, b in ((30, 80), (50, 60), (40, 95))]

    records = records_of(runs)

    first, second, third = (record.column("peak_temperature") for record in records)
    np.testing.assert_allclose(first, np.linspace(30, 80, 2000), atol=0.1)
    np.testing.assert_allclose(second, 80.0, atol=0.1)
    np.testing.assert_allclose(third, np.maximum(80.0, np.linspace(40, 95, 2000)), atol=0.1)


def test_runs_are_numbered_on_from_those_recorded_before() -> None:
    """The numbers of validation runs follow those of the training runs."""
    runs = [run_at(np.full(2000, 40.0)) for _ in range(2)]

    records = records_of(runs, first=5, hottest=90.0)

    assert [record.run for record in records] == [5, 6]
    assert records[1].column("run")[0] == 6.0
    assert records[0].column("peak_temperature")[0] == 90.0


def test_clipped_samples_have_no_weight() -> None:
    """A sensor at its limit does not measure; only its channel is masked."""
    clipped = np.zeros(2000, dtype=bool)
    clipped[100:120] = True

    (record,) = records_of([run_at(None, clipped={"current_A": clipped})])

    assert record.weight[:, 0].sum() == 1980
    assert record.weight[:, 1].sum() == 2000
    assert np.all(record.weight[100:120, 0] == 0.0)


def test_a_logged_angle_is_used_and_a_missing_one_integrated() -> None:
    """Reference: integral of 100 sin(20 t) in closed form."""
    run = run_at(None)
    angle = np.linspace(3.0, 4.0, 2000)

    (with_angle,) = records_of([replace(run, position=angle)])
    (without,) = records_of([run])

    np.testing.assert_array_equal(with_angle.column("angle"), angle)
    np.testing.assert_array_equal(with_angle.column("angle_next")[:-1], angle[1:])
    expected = 5.0 * (1.0 - np.cos(20 * run.time))
    np.testing.assert_allclose(without.column("angle"), expected, atol=1e-3)


def test_the_head_of_a_record_is_robust_against_one_bad_sample() -> None:
    """The median of three samples rejects one outlier."""
    run = run_at(None)
    current = run.current.copy()
    current[0] = 1e3

    (record,) = records_of([replace(run, current=current)])

    assert abs(record.head[0]) < 1.0


def test_nothing_is_smoothed_across_a_gap_to_another_temperature() -> None:
    """For 40 pieces at 25 and 85 degC in turn, smoothing across the gaps would err by 30 K."""
    levels = np.repeat(np.tile([25.0, 85.0], 20), 200)
    noise = np.random.default_rng(4).normal(0.0, 0.1, levels.size)
    segments = tuple((k * 200, (k + 1) * 200) for k in range(40))
    run = replace(run_at(levels + noise, levels.size), segments=segments)

    assert np.abs(smoothed(run) - levels).max() < 0.3


def test_a_gap_without_a_step_does_not_change_the_smoothing() -> None:
    """Missing rows do not shorten the stretch over which noise is averaged."""
    truth = np.linspace(25.0, 60.0, 4000)
    logged = truth + np.random.default_rng(5).normal(0.0, 0.5, truth.size)
    whole = run_at(logged, truth.size)
    cut = replace(whole, segments=tuple((k * 40, (k + 1) * 40) for k in range(100)))

    np.testing.assert_array_equal(smoothed(cut), smoothed(whole))
