"""Fits of long records, whose derivatives are computed in blocks, equal those in one piece."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from identification.fit import derivatives, normal_equations
from identification.fit.declared import fit_declared
from identification.fit.effective_samples import effective_fraction, scattered_fraction
from identification.fit.solve import Fit, solve
from identification.model.excitation import records_of
from identification.model.tangent import tangent_blocks
from tests.motors import campaign, motor_named
from tests.posterior.test_sample import servo_fit


def in_blocks(monkeypatch: pytest.MonkeyPatch, rows: int) -> None:
    """Discard the derivatives and compute them in blocks of the given number of samples."""
    monkeypatch.setattr(normal_equations, "_KEPT", 0)
    monkeypatch.setattr(derivatives, "tangent_blocks", partial(tangent_blocks, rows=rows))


def coloured(fit: Fit) -> Fit:
    """Fit under a coloured noise model, started 3 standard deviations from its optimum."""
    taps = (np.array([1.0, -0.6, 0.1]), np.array([1.0, -0.3]))
    weighting = replace(fit.weighting, whitening=taps)
    start = fit.position + 3.0 * np.sqrt(np.diag(fit.equations.covariance()))
    return solve(fit.simulator, fit.coordinates, start, fit.states, weighting)


def test_a_fit_in_blocks_ends_where_the_fit_of_whole_records_does(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The order of summation changes the estimates by at most 1e-6 standard deviations.

    With coloured noise, each block but the first needs the residuals before it.
    """
    whole = coloured(servo_fit())
    in_blocks(monkeypatch, 500)

    ours = coloured(servo_fit())

    assert ours.equations.derivatives.kept is None
    assert whole.equations.derivatives.kept
    spread = np.sqrt(np.diag(whole.equations.covariance()))
    assert np.abs((ours.position - whole.position) / spread).max() < 1e-6
    np.testing.assert_allclose(
        ours.equations.information, whole.equations.information, rtol=1e-9, atol=1e-9
    )


def test_curvature_along_a_step_is_that_of_whole_records(monkeypatch: pytest.MonkeyPatch) -> None:
    """Reference: the sum over whole records; only the order of summation differs."""
    fit = coloured(servo_fit())
    rng = np.random.default_rng(2)
    rows = [record.rows for record in fit.simulator.records]
    changes = [
        fit.equations.logged[k][:, :, None] + rng.normal(size=(n, 2, 3)) for k, n in enumerate(rows)
    ]
    directions = [rng.normal(size=(fit.position.size + 2, 3)) for _ in rows]
    expected, finite = fit.equations.curved(directions, changes, 0.1, fit.weighting)
    in_blocks(monkeypatch, 700)

    ours, also = fit.light().equations.curved(directions, changes, 0.1, fit.weighting)

    assert finite.all()
    assert also.all()
    for a, b in zip(ours, expected, strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-9, atol=1e-9 * np.abs(b).max())


@pytest.mark.parametrize("share", [effective_fraction, scattered_fraction])
def test_the_share_of_independent_samples_is_that_of_whole_records(
    monkeypatch: pytest.MonkeyPatch, share: Callable[[Fit], float]
) -> None:
    """The filter state carries over between blocks; only the order of summation differs.

    White noise filtered by a sum of neighbours is correlated, so the effective number of samples is
    smaller.
    """
    fit = servo_fit()
    adding = np.array([1.0, 0.8])
    fit = replace(fit, weighting=replace(fit.weighting, whitening=(adding, adding)))
    expected = share(fit)
    in_blocks(monkeypatch, 600)

    assert share(fit.light()) == pytest.approx(expected, rel=1e-9)
    assert expected < 0.9


def test_campaigns_beyond_the_limit_keep_no_derivatives(monkeypatch: pytest.MonkeyPatch) -> None:
    """A campaign of 2 x 400 samples keeps all at a limit of 800 and none at 799."""
    records = records_of(campaign(motor_named("servo 100 W"), seed=5, runs=2, rows=400))

    monkeypatch.setattr(normal_equations, "_KEPT", 799)
    assert fit_declared(records, "zoh").equations.derivatives.kept is None
    monkeypatch.setattr(normal_equations, "_KEPT", 800)
    assert fit_declared(records, "zoh").equations.derivatives.kept is not None
