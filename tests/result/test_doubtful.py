"""Parameters that implausible values make doubtful, however well the runs determine them."""

from __future__ import annotations

from dataclasses import replace

import pytest

from identification.checks.plausible import resistance_findings, time_constant_findings
from identification.result.content import doubtful_parameters
from identification.selection.omitted import OmittedTerm

VALUES = {"Ra25": 4.0, "alpha_Ra": -0.01, "Kt25": 0.02, "J": 2e-6, "b": 2e-6, "L": 0.1}
"""A motor of a few watts with an electrical time constant of 25 ms."""
TRUSTED = dict.fromkeys(VALUES, True)
MISSED = OmittedTerm("current_filter", gain=150.0, chance=10.0, steps={"L": -1.0})


@pytest.mark.parametrize(
    ("omitted", "doubtful"),
    [
        ([], set()),
        ([MISSED], {"L", "Ra25", "J", "b"}),
        ([replace(MISSED, parameter="L")], set()),
        ([replace(MISSED, surrogate=0.0)], set()),
        ([replace(MISSED, name="current_gain", gain=None, chance=None)], set()),
    ],
)
def test_long_electrical_time_constant_is_doubted_if_the_residual_misses_a_term(
    omitted: list[OmittedTerm], doubtful: set[str]
) -> None:
    """A motor with a choke in its leads has no other misfit; one behind a slow sensor has."""
    found = [one for one in time_constant_findings(VALUES, TRUSTED) if "electrical" in one.code]

    assert len(found) == 1
    assert doubtful_parameters(found, omitted) == doubtful


def test_resistance_that_falls_with_temperature_is_doubted_in_any_case() -> None:
    """Copper does not, so that another series voltage has taken the place of the resistance."""
    deviations = dict.fromkeys(VALUES, 1e-4)

    found = resistance_findings(VALUES, deviations, TRUSTED)

    assert doubtful_parameters(found, []) == {"Ra25", "alpha_Ra", "L"}
