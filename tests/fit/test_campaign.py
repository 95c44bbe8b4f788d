"""Detection of identical samples in several files, and the warnings about them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from identification.fit.campaign import campaign_of
from identification.ingest.run import Run
from tests.motors import campaign, motor_named

SERVO = motor_named("servo 100 W")


def bench_runs() -> list[Run]:
    """Three short runs of the servo motor."""
    return campaign(SERVO, seed=1, rows=200)


def copy_of(run: Run, name: str = "copy.csv") -> Run:
    """The same samples in another file, logged with another time origin."""
    return replace(run, name=name, sha256="1" * 64, time=run.time + 3.0, current=run.current.copy())


def test_runs_that_differ_are_not_reported_as_copies() -> None:
    """Same motor and drive, but different noise; only a copy has equal noise."""
    first, *_ = bench_runs()
    again = replace(first, current=first.current[::-1].copy())

    found = campaign_of([first, again], [])

    assert found.alike == (None, None)
    assert found.warnings == ()


def test_a_run_fitted_twice_gives_a_warning_of_narrow_intervals() -> None:
    """Counting the same data three times narrows intervals by a factor of sqrt(3) = 1.7."""
    first, second, _ = bench_runs()

    found = campaign_of([first, second, copy_of(first), copy_of(first, "old.csv")], [])

    [warning] = found.warnings
    assert found.alike == (None, None, 0, 0)
    assert warning.message.startswith("run0.csv, copy.csv and old.csv hold the same samples: ")
    assert "too narrow by up to 1.7 times" in warning.message


def test_a_validation_run_that_is_fitted_too_validates_nothing() -> None:
    """The copy is found although its bytes and its clock differ."""
    first, second, third = bench_runs()

    found = campaign_of([first, second], [third, copy_of(second)])

    [warning] = found.warnings
    assert found.alike == (None, None, None, 1)
    assert warning.message.startswith("run1.csv and copy.csv hold the same samples: ")
    assert "they check neither it nor its effects" in warning.message


def test_one_name_given_twice_is_named_once() -> None:
    """The same file is a training run and a validation run."""
    first, *_ = bench_runs()

    [warning] = campaign_of([first], [first]).warnings

    assert warning.message.startswith(
        "2 of the runs given, named run0.csv, hold the same samples: "
    )


def test_a_validation_run_given_twice_is_reported() -> None:
    """Two copies among the validation runs, neither of them fitted."""
    first, second, _ = bench_runs()

    [warning] = campaign_of([first], [second, copy_of(second)]).warnings

    assert "they count 2 times in the validation errors" in warning.message


def test_constant_runs_are_not_reported_as_copies() -> None:
    """Two recordings of a bench that is switched off are equal without being copies."""
    first, *_ = bench_runs()
    still = np.zeros(50)
    off = Run("off.csv", "0" * 64, first.time[:50], still, still, still, still + 25.0)

    assert campaign_of([first, off, replace(off, name="off2.csv")], []).warnings == ()
