"""A resistance that does not rise with temperature as copper does is reported."""

import pytest

from identification.checks.resistance import resistance_findings

TRUSTED = {"alpha_Ra": True}


@pytest.mark.parametrize("share", [1.0, 0.5, 0.3, 1.02])
def test_copper_with_leads_and_brushes_is_plausible(share: float) -> None:
    """A winding that is a third of the resistance has a third of copper's 0.0039 1/K."""
    assert resistance_findings({"alpha_Ra": share * 0.0039}, {"alpha_Ra": 1e-5}, TRUSTED) == []


@pytest.mark.parametrize("value", [-5e-4, 0.0, 0.012])
def test_resistance_that_is_no_copper_is_reported(value: float) -> None:
    """No conductor of a motor cools when it warms, or has three times the coefficient of copper."""
    (found,) = resistance_findings({"alpha_Ra": value}, {"alpha_Ra": 1e-4}, TRUSTED)
    assert found.code == "resistance_coefficient"
    assert found.severity == "suspect"
    assert "--known Ra25=VALUE" in found.message


def test_an_uncertain_or_given_coefficient_is_not_reported() -> None:
    """Runs at one temperature leave the coefficient open; a given one is the user's."""
    assert resistance_findings({"alpha_Ra": -5e-4}, {"alpha_Ra": 1e-3}, TRUSTED) == []
    assert resistance_findings({"alpha_Ra": -5e-4}, {"alpha_Ra": 1e-5}, {"alpha_Ra": False}) == []
