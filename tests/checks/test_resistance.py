"""A resistance that does not rise with temperature as copper does is reported."""

import pytest

from identification.checks.finding import Finding
from identification.checks.plausible import heating_findings, is_refuted, resistance_findings

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


@pytest.mark.parametrize(
    ("code", "alpha", "spread", "is_trusted", "expected"),
    [
        ("suspicious_unit", 0.0039, 1e-5, True, True),
        ("suspicious_unit", 0.0039, 5e-4, True, False),
        ("suspicious_unit", 0.0039, 1e-5, False, False),
        ("suspicious_unit", 0.00245, 1e-5, True, False),
        ("wrong_unit", 0.0039, 1e-5, True, False),
    ],
)
def test_coefficient_of_copper_refutes_degrees_fahrenheit(
    code: str, alpha: float, spread: float, is_trusted: bool, expected: bool
) -> None:
    """A reading of 25 degF is -3.9 degC: copper has 1 / (1.8 * (234.5 - 3.9)) = 0.0024 per degF."""
    finding = Finding(code, "suspect", "", "temperature_degC", "", "alpha", 0.0023, 0.0029)
    values, deviations = {"alpha_Ra": alpha}, {"alpha_Ra": spread}
    assert is_refuted(finding, values, deviations, {"alpha_Ra": is_trusted}) is expected


def test_winding_cannot_be_hotter_than_its_insulation_endures() -> None:
    """From 25 degC to class 250 of IEC 60085 are 225 K."""
    assert heating_findings(0.0) == heating_findings(224.0) == []
    (found,) = heating_findings(381.0)
    assert (found.code, found.severity) == ("winding_heating", "suspect")
    assert "381 K" in found.message
