"""Search on a representative subset of long records."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identification.effects.catalogue import CATALOGUE
from identification.fit.campaign import Campaign, campaign_of
from identification.fit.declared import fit_declared
from identification.ingest.run import Run
from identification.selection.candidates import scales_of
from identification.selection.subset import informative_segments, representative_subset
from tests.motors import campaign, motor_named

MOTOR = motor_named("servo 100 W")


@pytest.fixture(scope="module")
def long_campaign() -> Campaign:
    """Three runs of 20,000 samples, the last for validation; only the third quarter is excited."""
    runs = campaign(MOTOR, seed=3, rows=20_000, runs=3)
    return campaign_of([_quiet(run) for run in runs[:2]], [_quiet(runs[2])])


def _quiet(run: Run) -> Run:
    """The run with a motor at rest except in its third quarter."""
    lively = np.zeros(run.rows, dtype=bool)
    lively[10_000:12_500] = True
    return replace(
        run,
        voltage=np.where(lively, run.voltage, 0.0),
        current=np.where(lively, run.current, 0.0),
        speed=np.where(lively, run.speed, 0.0),
    )


def test_part_is_a_stretch_of_each_record_where_something_happens(long_campaign: Campaign) -> None:
    """5,000 of 20,000 samples each; the excited 2,500 start at sample 10,000."""
    declared = fit_declared(long_campaign.training, "zoh")

    found = representative_subset(long_campaign, declared)

    assert found is not None
    part, nominal = found
    assert [record.run for record in part.training] == [0, 1]
    for record, whole in zip(part.training, long_campaign.training, strict=True):
        assert record.rows == 5_000
        assert record.start <= 10_000
        assert record.start + record.rows >= 12_500
        assert record.inputs[-1, 0] == 0.0
        span = slice(record.start, record.start + record.rows)
        np.testing.assert_array_equal(record.measured, whole.measured[span])
    assert sum(record.rows for record in part.validation) == 5_000
    assert nominal.coordinates.names == declared.coordinates.names


@pytest.mark.parametrize("name", ["self_heating", "load_step"])
def test_a_slow_effect_has_on_segments_the_longest_time_of_the_whole_runs(
    long_campaign: Campaign, name: str
) -> None:
    """A segment of a quarter of a run shows a part of the same time constant or load."""
    declared = fit_declared(long_campaign.training, "zoh")
    found = representative_subset(long_campaign, declared)
    assert found is not None

    longest = [
        [p.upper for p in candidate.term.parameters if p.unit == "s"]
        for fit in (declared, found[1])
        for candidate in CATALOGUE[name].candidates(scales_of(fit))
    ]

    assert longest[0]
    assert longest[1] == longest[0]


def test_short_records_are_searched_whole() -> None:
    """Three runs of 1,500 samples are shorter than a subset."""
    runs = campaign_of(campaign(MOTOR, seed=3), [])

    assert representative_subset(runs, fit_declared(runs.training, "zoh")) is None


def test_a_campaign_without_validation_runs_has_no_validation_segments() -> None:
    """The search of long runs selects segments of both kinds."""
    assert informative_segments([], 1000) == []
