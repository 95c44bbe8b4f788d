"""Statistics of `make calibration`, and the coverage of a few campaigns."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from bench import make_campaign
from benchmarks.calibration.__main__ import main
from benchmarks.calibration.campaign import metric_draws, rank
from benchmarks.calibration.plan import KINDS, NOISES, item_of
from benchmarks.calibration.statistics import coverage, uniformity
from benchmarks.calibration.withheld import both_measured, comparison
from identification.fit.campaign import campaign_of
from identification.fit.declared import fit_declared
from identification.fit.effective_samples import effective_fraction
from identification.fit.noise import with_noise_model
from identification.ingest.given import run_of
from identification.posterior.density import Posterior
from tests.motors import NAMES

PAPER = dict(zip(NAMES, (0.59, 0.004, 0.071, -0.002, 0.01, 0.1, 0.5), strict=True))


def test_the_first_campaigns_hold_each_kind_with_each_noise_once() -> None:
    """The Chinese remainder theorem: 3 and 5 have no common factor."""
    cells = {(item.kind, item.noise) for item in map(item_of, range(15))}

    assert cells == {(kind, noise) for kind in KINDS for noise in NOISES}


def test_an_omitted_effect_is_never_available_to_the_search() -> None:
    """It is withheld or it is not in the catalogue; other kinds withhold nothing."""
    for item in map(item_of, range(60)):
        hidden = () if item.effect is None else (item.effect.name,)
        assert item.withheld in ((), hidden)
        assert item.withheld == () or item.kind == "omitted"
        assert (hidden == ()) is (item.kind == "clean")


def test_a_pair_of_fits_gives_the_ratio_of_their_widths_and_marks_a_missed_value() -> None:
    """Widths 0.4 and 0.1; J is wrong by 0.2, four half widths, and its rank is beyond 0.95."""
    without = {name: [0.5, 0.0, 0.1, True, 0.4] for name in NAMES}
    without["J"] = [0.99, 2.0, 0.1, True, 0.4]
    known = {name: [0.5, 0.0, 0.1, True, 0.1] for name in NAMES}
    line = {
        "number": 2, "noise": "spiky", "rows": 700, "hidden": ["brush_drop", "knee"],
        "named": [], "seconds": 5.0, "parameters": without,
        "allowed": {"named": ["brush_drop"], "seconds": 4.0, "parameters": known},
    }  # fmt: skip

    text = comparison([line], "command", "machine")

    assert "| `J` | 0 % | 100 % | 1 of 1 | 1 of 1 | 4.00 | 4.00 | 1 of 1 | 1 |" in text
    assert "| all | 75 % | 100 % | 4 of 4 | 4 of 4 | 4.00 | 4.00 | 4 of 4 | 1 |" in text
    assert "| nothing | brush_drop | 4.00, 4.00, 4.00*, 4.00 |" in text


def test_a_campaign_that_withholds_nothing_has_no_pair_of_fits() -> None:
    """Clean motors and effects that the catalogue lacks have no complete model to compare with."""
    assert both_measured(item_of(0)) is None


def test_ranks_are_uniform_exactly_if_the_draws_have_the_spread_of_the_truth() -> None:
    """Draws with half the spread of the truth leave too many true values outside."""
    rng = np.random.default_rng(4)

    def ranks_with(spread: float) -> list[float]:
        found = (
            rank(spread * rng.standard_normal(500), rng.standard_normal(), k) for k in range(400)
        )
        return [value for value in found if value is not None]

    assert uniformity(ranks_with(1.0)) > 0.01
    assert uniformity(ranks_with(0.5)) < 1e-6


def test_a_rank_splits_ties_evenly_and_needs_a_spread() -> None:
    """Half of the draws equal the truth, none is below: the rank lies in [0, 0.5]."""
    draws = np.repeat([0.0, 1.0], 50)
    found = [rank(draws, 0.0, seed) or 0.0 for seed in range(200)]

    assert 0.0 <= min(found) <= max(found) <= 0.5
    assert np.mean(found) == pytest.approx(0.25, abs=0.05)
    assert rank(np.ones(10), 1.0, 0) is None
    assert rank(np.array([1.0, np.inf]), 1.0, 0) is None


def test_feedback_metrics_of_the_paper_motor() -> None:
    """Steady state of unity feedback with gain 1: Kt / (Kt + Ra b + Kt^2)."""
    expected = 0.071 / (0.071 + 0.59 * 0.1 + 0.071**2)

    assert metric_draws(PAPER, 25.0)["steady_state"] == pytest.approx([expected])


def test_the_error_of_coverage_counts_campaigns_and_not_intervals() -> None:
    """Two campaigns, one with all and one with no interval right: 50 % with an error of 35 %."""
    lines = [
        {"parameters": {name: [value, 0.0, 0.1, True] for name in NAMES}} for value in (0.5, 0.99)
    ]
    found = coverage(lines, "parameters")

    assert found is not None
    assert (found.intervals, found.campaigns, found.fraction) == (14, 2, 0.5)
    assert found.error == pytest.approx(np.sqrt(0.125))


def test_intervals_of_a_few_motors_are_neither_half_nor_twice_as_wide() -> None:
    """Mean squared deviation over variance: 1, against 4 and 1/4; L may end at its bound of 0.

    The limits are those of a chi-square law with one independent parameter for every two.
    """
    squares = []
    for seed in range(12):
        campaign = make_campaign(70 + seed, seed=seed, rows=400, training=4, validation=0)
        runs = [run_of(run.frame) for run in campaign.training]
        fit = with_noise_model(fit_declared(campaign_of(runs, []).training, "zoh"))
        draws = Posterior(fit, effective_fraction(fit)).normal_draws(seed)
        for name in set(NAMES) - {"L"}:
            error = draws[name].mean() - campaign.truth["parameters"][name]
            squares.append((error / draws[name].std()) ** 2)

    low, high = stats.chi2.interval(0.999, len(squares) // 2)
    assert low < np.sum(squares) / 2 < high
    assert not low < 4.0 * np.sum(squares) / 2 < high
    assert not low < 0.25 * np.sum(squares) / 2 < high


def test_an_interrupted_measurement_is_resumed(tmp_path: Path) -> None:
    """A campaign in the log is not repeated; the page and both figures come from the whole log."""
    log, out = tmp_path / "log.jsonl", tmp_path / "docs" / "benchmarks" / "page.md"
    words = ["--campaigns", "1", "--first", "87", "--log", str(log), "--out", str(out)]
    main(words)
    first = log.read_text()

    main(words)

    assert log.read_text() == first
    assert "| clean | 1 |" in out.read_text()
    pictures = tmp_path / "docs" / "pictures" / "calibration"
    assert sorted(path.name for path in pictures.iterdir()) == ["feedback.svg", "parameters.svg"]
