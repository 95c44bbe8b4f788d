"""Draws of the models: physical signs, and no motor without an end."""

from __future__ import annotations

import numpy as np
import pytest

from identification import ComputationError
from identification.posterior.draws import within_signs


def test_draws_without_an_end_are_no_motor() -> None:
    """They are an error of the calculation, and no option of the user."""
    draws = {"Ra25": np.ones(3), "Kt25": np.array([1.0, np.inf, 2.0])}

    with pytest.raises(ComputationError, match=r"posterior of Kt25 .* compare the largest values"):
        within_signs(draws)
