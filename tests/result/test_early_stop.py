"""Warnings of stages that stopped early."""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from identification.fit.solve import Fit
from identification.posterior.convergence import Convergence
from identification.posterior.sample import Sample
from identification.result.early_stop import early_stop_warnings
from identification.selection.outcome import Outcome


@pytest.mark.parametrize(
    ("effort", "fix"),
    [
        ("quick", "--effort normal allows four times as many operations"),
        ("normal", "--effort thorough allows ten times as many operations"),
        ("thorough", "use shorter or fewer runs"),
    ],
)
def test_the_advice_is_the_next_effort(effort: str, fix: str) -> None:
    """There is none above thorough."""
    converged = cast(Fit, SimpleNamespace(converged=True))
    stopped = cast(Outcome, SimpleNamespace(complete=False, effects=(), is_scored=True))

    (warning,) = early_stop_warnings(converged, stopped, None, effort, None)

    assert warning.fix == fix


@pytest.mark.parametrize(
    ("r_hat", "text"), [(1.0374, "R-hat 1.037;"), (2.5e16, "R-hat above 1000;")]
)
def test_r_hat_of_walkers_that_stay_in_place_is_no_row_of_digits(r_hat: float, text: str) -> None:
    """It is divided by a variance that is nearly zero."""
    convergence = Convergence(32, 10, 0.0, 10.0, 1.0, r_hat, reached=False)
    sample = Sample(np.zeros((10, 32, 1)), None, ("Ra25",), ("ohm",), convergence, "normal")
    converged = cast(Fit, SimpleNamespace(converged=True))

    (warning,) = early_stop_warnings(converged, None, sample, "normal", None)

    assert warning.code == "sampler_not_converged"
    assert text in warning.message
    assert "--effort thorough" in warning.fix


def test_more_operations_are_no_advice_for_parameters_that_the_runs_do_not_determine() -> None:
    """Walkers move slowly along a ridge; a known value ends it."""
    convergence = Convergence(32, 10, 0.0, 10.0, 1.0, 4.0, reached=False)
    sample = Sample(np.zeros((10, 32, 1)), None, ("Ra25",), ("ohm",), convergence, "normal")
    converged = cast(Fit, SimpleNamespace(converged=True))

    (warning,) = early_stop_warnings(converged, None, sample, "normal", None, is_determined=False)

    assert "--effort" not in warning.fix
    assert warning.option == "known"
