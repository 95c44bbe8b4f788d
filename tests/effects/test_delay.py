"""Channel delay in runs that start and end in motion, whose history is unknown."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bench import EffectRequest, Noise, make_campaign
from bench.campaign import Campaign as Recorded
from identification.effects.sensor import ChannelDelay
from identification.fit.declared import fit_declared
from identification.fit.evaluate import simulate_unseen
from identification.fit.solve import Fit
from identification.selection.candidates import scales_of
from identification.selection.refit import refitted_with, refitted_without
from identification.selection.screen import screened
from identification.selection.start import Start
from tests.effects.hidden import records_of_bench


def late(channel: str, motor: int, size: float) -> tuple[Recorded, Fit, Fit]:
    """Measured signal, nominal fit, and fit with the delay of that channel."""
    measured = make_campaign(
        motor,
        [EffectRequest("channel_delay", size=size, law=channel)],
        seed=motor - 10_000,
        rows=600,
        training=3,
        validation=1,
        noise=Noise(kind="white"),
    )
    declared = fit_declared(records_of_bench(measured).training, "zoh")
    (candidate,) = (
        one for one in ChannelDelay.candidates(scales_of(declared)) if one.term.variant == channel
    )
    assert candidate.tried is not None
    scored = screened(declared, [candidate])[0].starts
    starts = [*scored, *(Start(place) for place in candidate.tried.T)]
    return measured, declared, refitted_with(declared, candidate.term, starts)


@pytest.mark.parametrize(
    ("channel", "motor", "size", "samples"),
    [("current", 8_010_348, 0.2505, 2.505), ("voltage", 8_010_168, 0.1032, 2.0)],
)
def test_a_lag_comes_down_to_the_noise_whatever_was_before_the_run(
    channel: str, motor: int, size: float, samples: float
) -> None:
    """The true delay is that of the bench; a held voltage belongs to the sample before it."""
    measured, declared, fit = late(channel, motor, size)

    noise = np.array([measured.truth["noise"][n] for n in ("current_A", "speed_rad_s")])
    interval = scales_of(declared).interval
    assert fit.values[-1] / interval == pytest.approx(samples, abs=0.02)
    assert np.all(fit.weighting.deviation < 1.1 * noise)
    for s in simulate_unseen(fit, records_of_bench(measured).validation):
        error = np.sqrt(np.sum(s.record.weight * s.residual**2, axis=0) / s.record.weight.sum(0))
        assert np.all(error < 1.2 * noise)


def test_a_channel_that_counts_at_the_edges_alone_counts_there() -> None:
    """Only the first eight samples of the current are valid."""
    _, declared, _ = late("current", 8_010_348, 0.2505)
    record = declared.simulator.records[0]
    weight = record.weight.copy()
    weight[8:, 0] = 0.0

    kept = replace(record, weight=weight).within(((8, 0), (8, 3)))

    np.testing.assert_allclose(kept.weight.sum(axis=0), weight.sum(axis=0))
    np.testing.assert_array_equal(kept.weight[:, 0], weight[:, 0])
    assert np.all(kept.weight[:8, 1] == 0.0)


def test_samples_that_a_lag_cannot_know_count_again_without_it() -> None:
    """The number of weighted samples is the same with and without delay, for comparable costs."""
    _, declared, fit = late("current", 8_010_348, 0.2505)

    again = refitted_without(fit, "channel_delay")

    assert fit.weighting.counts == pytest.approx(declared.weighting.counts, rel=1e-12)
    assert [r.weight[0, 0] for r in fit.simulator.records] == [0.0] * 3
    for before, after in zip(declared.simulator.records, again.simulator.records, strict=True):
        np.testing.assert_array_equal(before.weight, after.weight)
    assert again.cost == pytest.approx(declared.cost, abs=1.0)
