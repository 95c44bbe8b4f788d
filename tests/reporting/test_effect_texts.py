"""Words on effects that the runs hardly support, or not at all."""

from __future__ import annotations

import copy
from typing import Any

import pytest

from identification.reporting.headline import effect_tiles, headline_sentences
from identification.reporting.summary import summary_sentences
from identification.result.effect_texts import effect_details, effect_probability
from tests.reports import make_report


@pytest.fixture
def result() -> dict[str, Any]:
    """Modifiable result of a motor with dry friction."""
    copied: dict[str, Any] = copy.deepcopy(dict(make_report(rows=300, with_effect=True).result))
    return copied


def test_a_model_that_explains_nothing_gives_no_probability(result: dict[str, Any]) -> None:
    """An NRMSE of 98 % leaves 4 % of the variance explained (1 - 0.98^2)."""
    result["effects"][0] |= {"probability": 0.9999, "comparable": False}
    result["errors"]["after"]["training"]["speed"]["nrmse"] = 0.98

    words = " ".join([*headline_sentences(result), *summary_sentences(result)])

    assert "99.9" not in words
    assert "The motor has" not in words
    assert "the model explains 4.0 % of the variance of the speed" in words
    assert effect_probability(result["effects"][0]) == "not applicable"


def test_the_alternatives_of_such_an_effect_have_no_probability_either() -> None:
    """The tile names them alone."""
    report = make_report(rows=300, with_effect=True)
    report.result["effects"][0]["comparable"] = False

    (tile,) = effect_tiles(report)

    assert (tile["probability"], tile["alternatives"]) == ("not applicable", "viscous temperature")


def test_the_tile_of_a_surrogate_is_no_claim() -> None:
    """An effect of the motor has a certain tile, a surrogate has not."""
    report = make_report(rows=300, with_effect=True)
    (certain,) = effect_tiles(report)
    report.result["effects"][0] |= {
        "probability": 0.06,
        "alternatives": [{"name": "unlisted", "probability": 0.94}],
    }

    (tile,) = effect_tiles(report)

    assert (certain["is_certain"], tile["is_certain"]) == (True, False)


def test_effects_that_the_runs_do_not_separate_are_named_together(result: dict[str, Any]) -> None:
    """In one direction, Coulomb friction and a load are the same constant torque."""
    result["effects"][0]["probability"] = 0.499
    result["effects"][0]["alternatives"] = [
        {"name": "load_torque", "probability": 0.5},
        {"name": "quadratic_drag", "probability": 0.001},
    ]

    first = headline_sentences(result)[0]

    assert "Coulomb friction or load torque (probability 49.9 %)" in first
    assert "quadratic drag" not in first


def test_a_surrogate_is_no_effect_of_the_motor(result: dict[str, Any]) -> None:
    """A term outside the catalogue is more probable: all sentences say so, and no bias is named."""
    result["effects"][0]["probability"] = 0.005
    result["effects"][0]["alternatives"] = [{"name": "unlisted", "probability": 0.995}]

    first, summary = headline_sentences(result)[0], " ".join(summary_sentences(result))

    assert first == (
        "The fit uses Coulomb friction (probability 0.5 %) in place of something that the "
        "catalogue lacks."
    )
    assert "in place of something that the catalogue lacks" in summary
    assert "extends the nominal model" not in summary
    assert "Without" not in summary


def test_a_surrogate_beside_an_effect_is_kept_apart(result: dict[str, Any]) -> None:
    """The final model extends the nominal one by the friction, and uses the load step."""
    step = copy.deepcopy(result["effects"][0]) | {"name": "load_step", "probability": 0.0003}
    step["alternatives"] = [{"name": "unlisted", "probability": 0.9997}]
    result["effects"].append(step)

    summary = " ".join(summary_sentences(result))
    certain, doubtful = summary.split(" The fit uses ")

    assert "extends the nominal model by Coulomb friction" in certain
    assert "load step" not in certain
    assert doubtful.startswith("load step in the mechanical equation")


def test_an_incomplete_model_casts_doubt_on_the_parameters_that_remain(
    result: dict[str, Any],
) -> None:
    """One parameter is not identified; the intervals of the others may be off too."""
    result["parameters"]["b"]["identified"] = False
    checks = [{"channel": "current", "role": "training", "passed": False}]
    result["diagnosis"]["remaining"] = {"missing": True, "checks": checks}

    assert headline_sentences(result)[-1] == (
        "The runs do not determine b; treat its value as unknown. The model is incomplete; an "
        "interval may not contain the true value."
    )


def test_an_unlisted_term_is_named_with_its_law(result: dict[str, Any]) -> None:
    """The equation and the drivers of an unlisted term do not say what it is."""
    law = "ripple of the speed sensor over the shaft angle"
    result["effects"][0] |= {"name": "unlisted", "variant": f"{law}, separate phase in each run"}
    result["effects"][0]["probability"] = 1.0

    words = " ".join([*headline_sentences(result), *summary_sentences(result)])

    assert f"unlisted ({law}, probability > 99.9 %)" in words
    assert f"{law}, probability > 99.9 %" in effect_details(result["effects"][0])
    assert "separate phase" not in words
