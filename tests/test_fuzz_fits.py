"""A few absurd campaigns of `make fuzz-fits`; the full measurement takes longer."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.absurd_runs import EXCITATIONS, FAULTS, drawn
from benchmarks.fuzz_fits import ending_of


@pytest.mark.parametrize("seed", range(20))
def test_an_absurd_campaign_ends_in_a_result_or_a_named_error(seed: int) -> None:
    """Runs of 50 to 100 samples, without sampling and without a search for effects."""
    case = drawn(seed, rows=100, effects=0.0, posterior=0.0)

    ending = ending_of(case)

    assert ending.kind != "internal"
    assert ending.warned == ()


@pytest.mark.parametrize("seed", [23, 20070])
def test_a_campaign_that_failed_with_an_internal_error_ends(seed: int) -> None:
    """A loop of 1e63 rad/s never ended, and a ridge that is not finite raised LinAlgError."""
    case = drawn(seed, rows=150, effects=0.02, posterior=0.005)

    assert ending_of(case).kind != "internal"


def test_the_same_seed_draws_the_same_campaign() -> None:
    """`--only SEED` repeats a reported campaign."""
    one, other = drawn(3), drawn(3)

    assert one.words == other.words
    for run, again in zip(one.training, other.training, strict=True):
        assert np.array_equal(run.current, again.current)


def test_each_fault_and_excitation_is_drawn() -> None:
    """300 campaigns have some 900 runs, each with one of 9 excitations and 1.4 of 26 faults."""
    missing = {*FAULTS, *EXCITATIONS}
    campaigns = (drawn(seed, rows=60) for seed in range(300))
    while missing and (campaign := next(campaigns, None)):
        words = ";".join(campaign.faults)
        missing -= {name for name in missing if name in words}

    assert missing == set()


def test_an_internal_error_is_reported_with_its_location(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A run without samples cannot come from the reader and has no named error."""
    case = drawn(0, rows=60, effects=0.0, posterior=0.0)
    broken = replace(case.training[0], voltage=np.zeros(3))

    ending = ending_of(replace(case, training=(broken,)))

    assert ending.kind == "internal"
    assert "identification/" in ending.message
