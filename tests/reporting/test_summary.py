"""Summary sentences of a report, which must not claim more than the numbers support."""

from __future__ import annotations

import copy
from typing import Any

import pytest

from identification.reporting.headline import (
    effect_tiles,
    error_bars,
    headline_sentences,
    key_figures,
)
from identification.reporting.summary import summary_sentences
from identification.reporting.tables import (
    error_rows,
    parameter_rows,
    run_rows,
    sampler_rows,
)
from identification.reporting.warnings import warning_groups
from tests.reports import make_report


def with_ratio(result: dict[str, Any], ratio: float, role: str = "validation") -> dict[str, Any]:
    """Set the noise ratio of the current in a result."""
    result["errors"]["after"][role]["current"]["noise_ratio"] = ratio
    return result


@pytest.mark.parametrize(
    ("ratio", "verdict", "tone"),
    [
        (1.00, "the residual does not exceed the sensor noise", "good"),
        (1.06, "a small part of the residual exceeds the sensor noise", "fair"),
        (3.00, "the model lacks an effect of the motor or of a sensor", "bad"),
    ],
)
def test_the_verdict_follows_the_noise_ratio(
    result: dict[str, Any], ratio: float, verdict: str, tone: str
) -> None:
    """The verdict depends on whether the ratio exceeds 1.02 and 1.1."""
    changed = with_ratio(result, ratio)

    assert verdict in " ".join(summary_sentences(changed))
    assert error_bars(changed)[0]["tone"] == tone


def with_failed_check(result: dict[str, Any], role: str) -> dict[str, Any]:
    """Let the residual of the final model be more than noise on the runs of one role."""
    checks = [{"channel": "current", "role": role, "passed": False}]
    result["diagnosis"]["remaining"] = {"missing": True, "checks": checks}
    return result


def test_an_incomplete_model_does_not_claim_that_its_intervals_hold(result: dict[str, Any]) -> None:
    """All parameters are identified, but the residual of the training runs exceeds the noise."""
    changed = with_failed_check(result, "training")

    assert "an interval may not contain the true value" in headline_sentences(changed)[-1]
    (count, *_) = key_figures(changed)
    assert (count.value, count.remark, count.tone) == ("7 of 7", "of an incomplete model", "fair")


def test_a_residual_of_the_validation_runs_alone_leaves_the_cause_open(
    result: dict[str, Any],
) -> None:
    """An effect that no training run contains is one cause, an unlogged temperature another."""
    changed = with_failed_check(result, "validation")

    assert "the validation runs may contain an effect or a condition" in " ".join(
        headline_sentences(changed)
    )
    assert key_figures(changed)[0].tone == "good"


def test_a_good_ratio_with_a_coloured_residual_is_reported(result: dict[str, Any]) -> None:
    """Noise estimated from the residual makes the ratio 1 for any model; whiteness decides."""
    told = " ".join(headline_sentences(result, coloured=["speed"]))

    assert "does not exceed the sensor noise" not in told
    assert "the residual of the speed is not white" in told
    assert error_bars(result, coloured=["speed"])[1]["tone"] == "fair"


def test_validation_runs_decide_the_verdict(result: dict[str, Any]) -> None:
    """Training errors are used only if there are no validation runs, and are named as such."""
    with_ratio(result, 7.0, role="training")
    assert "7.00" not in " ".join(summary_sentences(result))

    result["errors"]["after"]["validation"] = None

    assert "On the training runs, the ratio of RMSE to sensor noise is 7.00" in " ".join(
        summary_sentences(result)
    )


def test_parameters_that_are_not_identified_are_named(result: dict[str, Any]) -> None:
    """The summary lists alpha_Kt if the runs do not determine it."""
    result["parameters"]["alpha_Kt"]["identified"] = False

    assert "do not determine alpha_Kt" in " ".join(summary_sentences(result))


def test_a_parameter_of_an_effect_is_named_by_its_meaning() -> None:
    """The meaning that result.json gives, and the effect alone in a result without it."""
    report = make_report(rows=300, with_effect=True)
    (effect,) = report.result["effects"]
    effect["parameters"]["torque"]["meaning"] = "torque at high speed"
    rows = {row.name: row for row in parameter_rows(report)}

    assert rows["torque"].meaning == "Coulomb friction: torque at high speed"


def test_a_parameter_that_the_runs_do_not_determine_has_no_bias() -> None:
    """The difference of two priors is no error of the nominal model."""
    report = make_report(rows=300, with_effect=True)
    report.result["parameters"]["alpha_Kt"]["identified"] = False
    rows = {row.name: row for row in parameter_rows(report)}

    assert (rows["alpha_Kt"].shift, rows["alpha_Kt"].shift_bounds) == ("", "")
    assert rows["Ra25"].shift


def test_errors_of_a_role_without_runs_have_no_row(result: dict[str, Any]) -> None:
    """A null entry in the result gives no table row."""
    result["errors"]["after"]["validation"] = None

    assert {row.role for row in error_rows(result)} == {"training"}


def test_a_run_is_rated_by_the_noise_it_was_made_with() -> None:
    """The simulation is exact, so the noise ratio is 1 and the residual is white."""
    for row in run_rows(make_report(rows=4000)):
        assert float(row["current"][1]) == pytest.approx(1.0, abs=0.06)
        assert float(row["speed"][1]) == pytest.approx(1.0, abs=0.06)
        assert float(row["speed"][2].removeprefix("< ")) > 0.001


def test_a_copy_of_a_training_run_does_not_count_as_validation(result: dict[str, Any]) -> None:
    """The summary states that there is no independent validation and reports training errors."""
    training = [run for run in result["runs"] if run["role"] == "training"]
    copies = [dict(run, role="validation", same_as=k) for k, run in enumerate(training)]

    told = " ".join(summary_sentences(result | {"runs": training + copies}))

    assert "identical to training runs, so there is no independent validation" in told
    assert "not used in the fit" not in told
    assert "On the training runs" in told


def test_one_copy_among_validation_runs_is_counted(result: dict[str, Any]) -> None:
    """The other run remains a valid validation run."""
    training = [run for run in result["runs"] if run["role"] == "training"]
    left_out = [run for run in result["runs"] if run["role"] == "validation"][:1]
    copy = dict(training[0], role="validation", same_as=0)

    told = " ".join(summary_sentences(result | {"runs": [*training, *left_out, copy]}))

    assert "1 of these runs is identical to training runs" in told
    assert "On the validation runs" in told


@pytest.mark.parametrize("is_used", [True, False])
def test_values_that_were_used_are_named(result: dict[str, Any], is_used: bool) -> None:
    """The summary names the parameters whose given values were used."""
    for name in ("Kt25", "J"):
        result["parameters"][name]["prior"] = {
            "value": 0.07, "sd": 7e-4, "origin": "--known", "used": is_used,
            "identified_by_runs": True,
        }  # fmt: skip

    words = " ".join(summary_sentences(result))

    assert (
        "The intervals include the given knowledge (known values, nameplate) of Kt25 and J" in words
    ) is is_used


def test_three_sentences_open_the_report() -> None:
    """Effect, quality of the model and parameters; a certain effect keeps an upper limit."""
    result = copy.deepcopy(dict(make_report(rows=300, with_effect=True).result))
    result["effects"][0]["probability"] = 1.0

    assert headline_sentences(result) == [
        "The motor has an effect beyond the nominal model: Coulomb friction "
        "(probability > 99.9 %).",
        "On the validation runs, the residual does not exceed the sensor noise.",
        "The runs determine all 7 parameters.",
    ]


def test_an_effect_is_shown_with_its_evidence() -> None:
    """The tile has the estimates of the missing torque and the fall of both squared errors."""
    (tile,) = effect_tiles(make_report(rows=300, with_effect=True))

    assert tile["term"] is not None
    assert tile["term"].effect == "coulomb_friction"
    assert dict(tile["evidence"]) == {
        "Squared error, training": "−93 %",
        "Squared error, validation": "−92 %",
    }
    assert tile["alternatives"] == "viscous temperature 0.9 %"


def test_errors_before_and_after_share_one_scale() -> None:
    """Ratios 4.2 before and 1.0 after: the longest bar is full, the other 1 / 4.2 of it."""
    for bar in error_bars(make_report(rows=300, with_effect=True).result):
        before, after, noise = bar["widths"]

        assert before == 100.0
        assert after == noise == pytest.approx(100 / 4.2, abs=0.1)


def test_warnings_give_temperatures_as_the_tables_do(result: dict[str, Any]) -> None:
    """The command line writes degC, the pages °C, as on the axes of the plots."""
    result["warnings"] = ["the temperature was not logged in run.csv (45.9 degC)"]
    result["warning_details"] = [{"code": "estimated_temperature", "severity": "note", "fix": ""}]

    (group,) = warning_groups(result)

    assert group.items[0].message == "The temperature was not logged in run.csv (45.9 °C)"


def test_warnings_are_grouped_with_the_most_important_first(result: dict[str, Any]) -> None:
    """The remedy is separate from the message; a warning without details is no note."""
    result["warnings"] = ["run1.csv: a gap", "the runs do not determine J; log longer runs", "odd"]
    result["warning_details"] = [
        {"code": "gap", "severity": "note", "fix": ""},
        {"code": "x", "severity": "critical", "fix": "log longer runs", "fix_http": "in the form"},
    ]

    groups = warning_groups(result)

    assert [(group.severity, group.items) for group in groups] == [
        ("critical", (("The runs do not determine J", "Log longer runs", "in the form", "x"),)),
        ("warning", (("Odd", "", "", ""),)),
        ("note", (("run1.csv: a gap", "", "", "gap"),)),
    ]


@pytest.mark.parametrize(("steps", "verdict"), [(500, "yes"), (400, "no")])
def test_the_sampler_is_judged_by_the_limits_of_its_warning(steps: int, verdict: str) -> None:
    """500 steps are 53 autocorrelation times of 9.4 steps; 50 are required.  Acceptance is not."""
    data = make_report(rows=300)
    data.result["sampler"]["steps"] = steps

    rows = {label: verdict for label, _, _, verdict in sampler_rows(data)}

    assert rows["Length of the chain"] == verdict
    assert rows["R-hat, largest"] == "yes"
    assert rows["Acceptance"] == ""
