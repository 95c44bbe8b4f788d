"""A filter of the current takes its lag back from the inductance, also from a local optimum."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from identification.effects.sensor import CurrentFilter
from identification.fit.declared import fit_declared
from identification.fit.solve import Fit, TerminationLimits
from identification.ingest import Run
from identification.model.excitation import records_of
from identification.model.term import AbstractTerm
from identification.selection import refit
from identification.selection.candidates import scales_of
from identification.selection.start import Start

R, K, L, J, B, FILTER, STEP, ROWS = 4.2, 0.018, 3e-3, 2.5e-6, 8e-6, 10e-3, 1e-3, 1500


def filtered_run() -> Run:
    """Steps of a small motor in both directions, the current through a filter."""
    rng = np.random.default_rng(5)
    voltage = np.repeat(rng.uniform(-12.0, 12.0, ROWS // 150), 150)
    i, w, shown = 0.0, 0.0, 0.0
    current, speed = np.zeros(ROWS), np.zeros(ROWS)
    for k in range(ROWS):
        current[k], speed[k] = shown, w
        for _ in range(20):
            i += STEP / 20 / L * (voltage[k] - R * i - K * w)
            w += STEP / 20 / J * (K * i - B * w)
            shown += (i - shown) * STEP / 20 / FILTER
    current += rng.normal(0.0, 0.01, ROWS)
    speed += rng.normal(0.0, 1.0, ROWS)
    return Run("r.csv", "r", STEP * np.arange(ROWS, dtype=np.float64), voltage, current, speed)


def test_a_fit_that_ends_with_the_whole_lag_in_the_inductance_is_repeated(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The first fit ends at a small filter beside the large L, as at a local optimum."""
    fit = fit_declared(records_of([filtered_run()]), "zoh")
    candidate = CurrentFilter.candidates(scales_of(fit))[0]
    small = Start(candidate.starts[:, 0])
    fitted, starts_of_fits = refit.refitted_with, []

    def ended_early(
        fit: Fit, term: AbstractTerm, starts: Sequence[Start], limits: TerminationLimits
    ) -> Fit:
        starts_of_fits.append(len(starts))
        if len(starts_of_fits) == 1:
            return fitted(fit, term, [small], TerminationLimits(0))
        return fitted(fit, term, starts, limits)

    monkeypatch.setattr(refit, "refitted_with", ended_early)
    found = refit.fitted_candidate(fit, candidate, [small]).by_name

    assert fit.by_name["L"] > 5.0 * L
    assert starts_of_fits == [1 + len(candidate.traded), len(candidate.traded)]
    assert found["current_filter.time_constant"] == pytest.approx(FILTER, rel=0.2)
    assert found["L"] < 3.0 * L
