"""Account of the effect search: each claim is supported by the outcome and the result."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import pytest

from identification.effects.friction import CoulombFriction
from identification.fit.solve import Fit
from identification.result.account import account_of
from identification.result.models import searched_entries
from identification.selection.criteria import AcceptanceCriteria
from identification.selection.outcome import Alternative, Found, Outcome, Searched
from identification.surrogates.curves import MissingVoltage
from identification.surrogates.ripple import SpeedRipple

PASSED = AcceptanceCriteria(900.0, 12.0, 0.7, 0.6, 0.6, 800.0, False)
CHANCE = AcceptanceCriteria(3.0, 12.0, 0.001, 0.0, 0.0, 0.0, False)
UNLISTED = MissingVoltage("speed", "current", 1.0, 0.0, 1.0, 1.0, 1.0, 1.0)


def fit_with(*terms: object) -> Fit:
    """The part of a fit that the account reads: its terms."""
    model = SimpleNamespace(terms=terms)
    return cast(Fit, SimpleNamespace(simulator=SimpleNamespace(model=model)))


def result(off: bool = True) -> dict[str, Any]:
    """Diagnosis with one shift of 11 %."""
    relative = {"q05": 0.105, "median": 0.11, "q95": 0.115}
    return {
        "effects": [],
        "diagnosis": {
            "residual": {"sentence": "The model does not explain the current."},
            "trace": {},
            "remaining": {"sentence": "Nothing is missing."},
            "shifts": {"b": {"relative": relative, "off": off}},
        },
        "warnings": ["the model does not explain the current of the training runs", "a gap"],
        "warning_details": [{"code": "unexplained_channel"}, {"code": "gap"}],
    }


def outcome(name: str, *searched: Searched) -> Outcome:
    """Outcome with one found effect and one alternative."""
    other = Alternative("viscous_temperature", 0.03, fit_with(), 1.0)
    found = Found(name, 0.97, PASSED, (other,))
    return Outcome(fit_with(), (found,), searched)


def test_a_channel_is_named_once_among_what_remains() -> None:
    """The diagnosis and a warning state the same ratio of the same channel."""
    told = result()
    told["diagnosis"]["remaining"]["sentence"] = (
        "The model does not explain the current on the training runs: the residual is 6.16 times "
        "the sensor noise (limit 1.23); the residual is autocorrelated."
    )
    told["warnings"][0] = (
        "the model does not explain the current on the training runs: the residual is 6.161 times "
        "the sensor noise (limit 1.229)"
    )
    account = account_of(outcome("coulomb_friction"), told, fit_with(CoulombFriction(1.0, 1.0)))

    assert account is not None
    assert account.remaining == (told["diagnosis"]["remaining"]["sentence"],)


def test_fall_of_the_error_is_the_mean_of_both_channels() -> None:
    """A factor exp(-0.7) over both channels is exp(-0.35) for each, or 0.5 of its square."""
    account = account_of(outcome("coulomb_friction"), result(), fit_with(CoulombFriction(1.0, 1.0)))

    assert account is not None
    assert "averaged over current and speed, falls by 29.5 %" in " ".join(account.sentences)
    (row, *_) = account.candidates
    assert row.explained == pytest.approx(0.503, abs=1e-3)


def test_a_shift_is_reported_with_its_interval_and_its_cause() -> None:
    """The shift of b, 11 % (10.5 to 11.5 %), is attributed to the omitted friction."""
    account = account_of(outcome("coulomb_friction"), result(), fit_with(CoulombFriction(1.0, 1.0)))

    assert account is not None
    told = " ".join(account.sentences)
    assert "The nominal model omits Coulomb friction" in told
    assert "b is 11.00 % too high (10.50 to 11.50 %)" in told
    assert "viscous temperature (3 %)" in told
    assert account.remaining == (
        "Nothing is missing.",
        "The model does not explain the current of the training runs.",
    )


def test_a_surrogate_is_no_cause_of_a_bias() -> None:
    """A term outside the catalogue is more probable: the friction stands in for it."""
    others = [{"name": "unlisted", "probability": 0.99}]
    told = result()
    told["effects"] = [{"name": "coulomb_friction", "probability": 0.01, "alternatives": others}]
    account = account_of(outcome("coulomb_friction"), told, fit_with(CoulombFriction(1.0, 1.0)))

    assert account is not None
    words = " ".join(account.sentences)
    assert "Coulomb friction stands in for something that the catalogue lacks" in words
    assert "biased" not in words


def test_an_insignificant_shift_is_not_reported() -> None:
    """The account names only parameters that the result marks as off."""
    account = account_of(
        outcome("coulomb_friction"), result(off=False), fit_with(CoulombFriction(1.0, 1.0))
    )

    assert account is not None
    assert "too high" not in " ".join(account.sentences)


def test_an_unlisted_effect_is_described_by_its_own_attributes() -> None:
    """Equation and drivers come from the term, because the catalogue has no entry for it."""
    account = account_of(outcome("unlisted"), result(), fit_with(UNLISTED))

    assert account is not None
    told = " ".join(account.sentences)
    assert "No effect of the catalogue explains the missing voltage of the electrical" in told
    assert "a curve over current and speed" in told
    assert account.candidates[0].equation == "electrical"


def test_a_law_outside_the_catalogue_is_described_by_its_name() -> None:
    """A law of a sensor explains no torque."""
    ripple = SpeedRipple(logged=False, harmonics=2, ratio=1.0)
    account = account_of(outcome("unlisted"), result(), fit_with(ripple))

    assert account is not None
    told = " ".join(account.sentences)
    assert "the missing part of the sensor equation; the law “ripple of the speed sensor" in told


def test_candidates_begin_with_the_final_model_however_it_was_reached() -> None:
    """An effect that entered by exchange was chosen in no round, but is part of the final model."""
    account = account_of(
        outcome(
            "coulomb_friction",
            Searched("coulomb_friction", 1, 5.0, CHANCE, False),
            Searched("quadratic_drag", 1, 50.0, PASSED, True),
            Searched("viscous_temperature", 1, 40.0, PASSED, False),
            Searched("brush_drop", 1, 4.0, None, False),
        ),
        result(),
        fit_with(CoulombFriction(1.0, 1.0)),
    )

    assert account is not None
    verdicts = {candidate.name: candidate.verdict for candidate in account.candidates}
    assert next(iter(verdicts)) == "coulomb_friction"
    assert verdicts == {
        "coulomb_friction": "chosen",
        "viscous_temperature": "alternative",
        "quadratic_drag": "ruled out",
        "brush_drop": "ruled out",
    }
    reasons = {candidate.name: candidate.reason for candidate in account.candidates}
    assert "replaced by another effect" in reasons["quadratic_drag"]


@pytest.mark.parametrize(
    ("criteria", "chosen", "words"),
    [
        (PASSED, True, "reduces the error most"),
        (CHANCE, False, "not significant"),
        (None, False, "predicted gain"),
    ],
)
def test_every_candidate_has_a_reason(
    criteria: AcceptanceCriteria | None, chosen: bool, words: str
) -> None:
    """A candidate is chosen, fails a criterion, or has a predicted gain too small for a fit."""
    searched = Searched("load_torque", 1, 5.0, criteria, chosen)

    (entry,) = searched_entries(outcome("coulomb_friction", searched))

    assert words in entry["reason"]


def test_without_a_search_there_is_no_account() -> None:
    """No outcome gives no account."""
    assert account_of(None, result(), fit_with()) is None
