"""Warnings on stages that stopped early, with consequence and remedy."""

from __future__ import annotations

from typing import Final

from identification.fit.solve import Fit
from identification.posterior.convergence import LARGEST_R_HAT, REQUIRED_LENGTH
from identification.posterior.sample import Sample, Source
from identification.result.effect_texts import effect_words
from identification.result.numbers import listed
from identification.selection.outcome import Outcome
from identification.warning import Option, ResultWarning

__all__ = ["early_stop_warnings"]

_SUBSTITUTES: Final[dict[Source, str]] = {
    "chain": "the intervals may be too narrow",
    "importance": "the draws come from importance sampling instead, which is reliable here",
    "normal": "the draws come from the normal approximation instead, which is inaccurate for "
    "parameters near a bound and for strongly confounded parameters",
}

_UNDETERMINED: Final[tuple[str, Option | None]] = (
    "the walkers move slowly along parameters that the runs do not determine: record runs that "
    "determine them, or give --known NAME=VALUE",
    "known",
)
"""Advice for a sampler that more operations hardly help."""

_STUCK: Final = 1000
"""R-hat from which its value says no more than that no walker moved [-]."""


def early_stop_warnings(
    final: Fit,
    outcome: Outcome | None,
    sample: Sample | None,
    effort: str,
    time_limit: float | None,
    *,
    is_determined: bool = True,
) -> list[ResultWarning]:
    """Warnings on an early stop of the fit, the effect search or the sampler.

    `time_limit` is the limit that stopped a stage [s]; None if none did.  `is_determined` is true
    if the runs determine all parameters.
    """
    limit = f"the time limit of {time_limit} s" if time_limit is not None else ""
    warnings = []
    if not final.converged:
        message = (
            "the fit stopped before it converged; the values are the best that it found, and the "
            "intervals may be too narrow"
        )
        warnings.append(ResultWarning("fit_not_converged", "warning", message))
    if outcome is not None and not outcome.complete:
        message = (
            f"the effect search stopped at {limit or f'the budget of the effort {effort}'} before "
            "it was complete; effects and alternatives may be missing"
        )
        fix = _remedy(effort, limit)
        warnings.append(ResultWarning("search_incomplete", "warning", message, *fix))
    if outcome is not None:
        warnings += _undecided(outcome, effort, limit)
    if outcome is not None and not outcome.is_scored:
        message = (
            "no further term could be scored: with each of them the simulation diverges or the "
            "normal equations are not finite; effects may be missing"
        )
        remedy = "check the units and the sample interval of the runs, or sample faster"
        warnings.append(ResultWarning("search_incomplete", "warning", message, remedy))
    if sample is not None and not sample.convergence.reached:
        fix = _remedy(effort, limit) if is_determined or limit else _UNDETERMINED
        warnings.append(_unconverged(sample, limit, fix))
    return warnings


def _undecided(outcome: Outcome, effort: str, limit: str) -> list[ResultWarning]:
    """Warning on effects whose removal no fit decided."""
    names = [effect_words(found.name) for found in outcome.effects if found.is_undecided]
    if not names:
        return []
    message = (
        f"the fit of the model without {listed(names)} did not converge, also not from the nominal "
        "parameters, and may reach the model with it; the two count as equally probable"
    )
    return [ResultWarning("search_incomplete", "warning", message, *_remedy(effort, limit))]


def _unconverged(sample: Sample, limit: str, fix: tuple[str, Option | None]) -> ResultWarning:
    found = sample.convergence
    # Walkers that stay in place have hardly any variance within a half, by which R-hat is divided.
    r_hat = f"{found.r_hat_max:.3f}" if found.r_hat_max < _STUCK else f"above {_STUCK}"
    message = (
        f"the sampler did not converge: it stopped after {found.steps} steps, "
        f"{found.steps / found.autocorrelation_time:.1f} autocorrelation times, with R-hat "
        f"{r_hat}; expected at least {REQUIRED_LENGTH:g} and at most "
        f"{LARGEST_R_HAT}; "
        + _SUBSTITUTES[sample.source]
        + (f"; it stopped at {limit}" if limit else "")
    )
    return ResultWarning("sampler_not_converged", "warning", message, *fix)


def _remedy(effort: str, limit: str) -> tuple[str, Option | None]:
    """Advice for a stage that its budget or the time limit stopped, and the option in it."""
    if limit:
        return "raise --time-limit", "time_limit"
    if effort == "thorough":
        return "use shorter or fewer runs", None
    following, factor = ("normal", "four") if effort == "quick" else ("thorough", "ten")
    return f"--effort {following} allows {factor} times as many operations", "effort"
