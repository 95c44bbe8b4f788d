"""Identification pipeline from runs to a result; the only module that orders the stages.

    identification = identify(training, validation)
    identification.result["parameters"]["Ra25"]["median"]
    identification.write(Path("out"))

The stages are checks, nominal fit, effect search, posterior, feedback metrics and report.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from identification.checks.admission import admitted
from identification.diagnosis.detection import detect
from identification.diagnosis.localise import Localisation, localise
from identification.effects.catalogue import CATALOGUE
from identification.effort import EFFORTS
from identification.errors import ComputationError, InputError, OptionError
from identification.feedback import feedback_metrics, parse_controllers
from identification.feedback.nonlinear import simulated_loops
from identification.fit.campaign import Campaign, campaign_of
from identification.fit.declared import fit_declared
from identification.fit.gains import current_gains, with_one_gain
from identification.fit.knowledge import Knowledge
from identification.fit.noise import effective_fraction, with_noise_model
from identification.fit.solve import Fit
from identification.fit.temperature import with_scale_drawn
from identification.ingest.run import Run
from identification.options import FitOptions
from identification.posterior.checkpoint import Checkpoint
from identification.posterior.density import Posterior
from identification.posterior.normal import normal_draws
from identification.posterior.sample import Sample, sample
from identification.report.assemble import assemble
from identification.report.findings import Findings
from identification.report.gather import write_outputs
from identification.selection.confounded import confounded_terms
from identification.selection.long import search_long
from identification.selection.non_identifiable import (
    LinearPart,
    linear_parts_of,
    with_linear_parts,
    with_linear_parts_drawn,
)
from identification.selection.omitted import OmittedTerm, unknown_gain, with_omitted_drawn
from identification.selection.outcome import Outcome
from identification.threads import repeatable_algebra
from identification.work import metered, was_interrupted

__all__ = ["FitOptions", "Identification", "Progress", "identify"]

Array = NDArray[np.float64]
Progress = Callable[[str, float], None]
"""Called with the name of the stage and the completed fraction of the whole job."""

_LEAST_ROWS = 50
_LARGEST = 1e15
"""Largest value of a channel; beyond it, the squares of a long record exhaust double precision."""


@dataclass(frozen=True)
class Identification:
    """Result of the identification of a campaign.

    Args:
        result: Content of result.json.
        findings: All quantities that the report shows.
    """

    result: dict[str, object]
    findings: Findings

    def write(self, directory: str | os.PathLike[str]) -> None:
        """Write result.json, report.html and, where sampled, posterior.nc into `directory`.

        Every file appears complete or not at all.
        """
        write_outputs(Path(directory), self.result, self.findings)


_SIGNED = ("Ra25", "Kt25", "J", "b", "L")
_SUSPECT = ("opposite_signs", "unsigned_channel", "identical_channels", "constant_channel")
"""Codes of warnings that may explain a failed calculation, the most likely first."""


# A candidate that overflows has an infinite cost and is rejected; numpy warnings add nothing.
@np.errstate(all="ignore")
def identify(
    training: Run | Sequence[Run],
    validation: Run | Sequence[Run] = (),
    options: FitOptions = FitOptions(),  # noqa: B008  frozen
    progress: Progress | None = None,
    checkpoint: Checkpoint | None = None,
    withheld: Collection[str] = (),
) -> Identification:
    """Identify one motor from its runs.

    Args:
        training: Runs to fit, in the order in which they were recorded, or a single run.
        validation: Validation runs, or a single one; they are never fitted.
        options: Options of the user.
        progress: Called with the progress of the job.
        checkpoint: Where the chain of the posterior is saved, so that the same job can resume it.
        withheld: Effect types that the search must not add, to measure their contribution.

    Raises:
        InputError: There are too few samples, the runs contradict physics or each other, or an
            option is invalid.
        ComputationError: No model can be simulated over the runs.
    """
    training = [training] if isinstance(training, Run) else training
    validation = [validation] if isinstance(validation, Run) else validation
    try:
        with metered(_limit(options.time_limit)), repeatable_algebra():
            return _identified(training, validation, options, progress, checkpoint, withheld)
    except ComputationError as error:
        raise ComputationError(f"{error}{_suspects([*training, *validation])}") from error


def _limit(seconds: float | None) -> Callable[[], bool] | None:
    """Function that returns whether the time limit has passed; None without a limit."""
    if seconds is None:
        return None
    until = time.monotonic() + seconds
    return lambda: time.monotonic() > until


def _identified(
    training: Sequence[Run],
    validation: Sequence[Run],
    options: FitOptions,
    progress: Progress | None,
    checkpoint: Checkpoint | None,
    withheld: Collection[str],
) -> Identification:
    tell = progress or (lambda stage, fraction: None)
    tell("fit", 0.0)
    _check(training, validation)
    _check_withheld(withheld)
    parse_controllers(options.controllers)
    admission = admitted(training, validation, options)
    training, validation = admission.training, admission.validation
    campaign = campaign_of(training, validation)
    declared = _declared(campaign, options)
    gains = current_gains(declared, campaign)
    if gains:
        campaign = with_one_gain(campaign, gains)
        declared = _declared(campaign, options)
    knowledge = Knowledge(options.priors, options.plate.friction).beside(declared)
    # An effect may resolve a contradiction under the nominal model: known values are tested again
    # at the end.
    declared, _ = knowledge.joined_to(declared)
    found, outcome = _searched(declared, campaign, options, tell, withheld)
    tell("fit", 0.5)
    closed = with_noise_model(outcome.fit if outcome else declared)
    closed, contradicted = knowledge.joined_to(closed)
    opened = with_linear_parts(closed)
    final = closed if opened is closed else with_noise_model(opened)
    omitted = unknown_gain(closed, [gain.ratio for gain in gains])
    omitted += outcome.omitted if outcome else ()
    omitted += _confounded(declared, outcome)
    fraction = effective_fraction(closed)
    tell("posterior", 0.55)
    chain, draws = _drawn(
        Posterior(closed, fraction),
        linear_parts_of(final),
        omitted,
        options,
        lambda done: tell("posterior", 0.55 + 0.3 * done),
        checkpoint and checkpoint.about([run.sha256 for run in (*training, *validation)], options),
    )
    draws = _within_signs(draws)
    tell("feedback", 0.85)
    metrics = feedback_metrics(draws, options.temperatures, options.controllers)
    declared_draws = _declared_draws(declared, outcome, draws, options)
    changed = outcome is not None and bool(outcome.effects)
    left = localise(final) if found and changed else found
    tell("report", 0.9)
    findings = Findings(
        campaign=campaign,
        admission=admission,
        options=options,
        declared=declared,
        declared_draws=declared_draws,
        final=final,
        fraction=fraction,
        draws=draws,
        sample=chain,
        feedback=metrics,
        outcome=outcome,
        omitted=omitted,
        feedback_before=feedback_metrics(declared_draws, options.temperatures, options.controllers)
        if changed
        else [],
        loops=tuple(simulated_loops(final, draws, options.temperatures, options.controllers)),
        localisation=found,
        left=left,
        interrupted=was_interrupted(),
        contradicted=contradicted,
        before=detect(declared, campaign, left.noise) if left else None,
        after=detect(final, campaign, left.noise) if left else None,
    )
    result = assemble(findings)
    tell("done", 1.0)
    return Identification(result, findings)


def _searched(
    declared: Fit,
    campaign: Campaign,
    options: FitOptions,
    tell: Progress,
    withheld: Collection[str],
) -> tuple[Localisation | None, Outcome | None]:
    """Localisation of the nominal model's deficiency, and search outcome; None without a search."""
    if not options.effects:
        return None, None
    found = localise(declared)
    tell("effects", 0.15)
    rows = sum(record.rows for record in campaign.training)
    outcome = search_long(
        declared,
        campaign,
        lambda done: tell("effects", 0.15 + 0.35 * done),
        EFFORTS[options.effort].search_of(rows),
        withheld,
    )
    return found, outcome


def _confounded(declared: Fit, outcome: Outcome | None) -> tuple[OmittedTerm, ...]:
    """Effects that are confounded with parameters of the final model."""
    if outcome is None:
        return confounded_terms(declared)
    return confounded_terms(
        outcome.fit,
        declared if outcome.effects else None,
        is_structured=bool(outcome.omitted),
    )


def _check(training: Sequence[Run], validation: Sequence[Run]) -> None:
    if not training:
        raise InputError("no training run was given; expected at least one run file")
    rows = sum(run.rows for run in training)
    if rows < _LEAST_ROWS:
        raise InputError(
            f"the training runs have {rows} samples together; expected at least {_LEAST_ROWS}: "
            "record longer or give more runs",
            file=training[0].name,
            value=rows,
        )
    for run in (*training, *validation):
        _check_values(run)


def _check_withheld(kinds: Collection[str]) -> None:
    unknown = [kind for kind in kinds if kind not in CATALOGUE]
    if unknown:
        raise OptionError(
            f"withheld has the kind {unknown[0]!r}; expected kinds of {', '.join(CATALOGUE)}",
            value=unknown[0],
        )


def _check_values(run: Run) -> None:
    """Reject invalid values; a run need not come from the file reader, whose limits are tighter.

    Raises:
        InputError: Time does not increase, or a value is not finite or too large to be squared.
    """
    channels = {
        "voltage_V": run.voltage,
        "current_A": run.current,
        "speed_rad_s": run.speed,
        "temperature_degC": run.temperature,
        "position_rad": run.position,
    }
    for name, values in channels.items():
        if values is None:
            continue
        wrong = np.flatnonzero(~(np.abs(values) < _LARGEST))
        if wrong.size:
            raise InputError(
                f"sample {wrong[0]} is {values[wrong[0]]:.6g}; expected a finite value below "
                f"{_LARGEST:.0e}: check the sensor and its scale",
                file=run.name,
                column=name,
                value=float(values[wrong[0]]),
            )
    steps = np.diff(run.time)
    if not (np.isfinite(run.time).all() and (steps > 0).all()):
        raise InputError(
            "time does not increase from sample to sample; expected finite increasing seconds",
            file=run.name,
            column="time_s",
        )


def _declared(campaign: Campaign, options: FitOptions) -> Fit:
    """Fit of the nominal model.

    If the user leaves the hold open and effects are searched, the fit assumes zero-order hold, as
    drives apply it, and the search detects deviations.  Without a search, the better one of
    zero-order and first-order hold is taken.
    """
    if options.hold != "auto":
        return fit_declared(campaign.training, options.hold)
    if options.effects:
        return fit_declared(campaign.training, "zoh")
    fits = [fit_declared(campaign.training, hold) for hold in ("zoh", "foh")]
    return min(fits, key=lambda fit: fit.cost)


def _drawn(
    posterior: Posterior,
    lines: Sequence[LinearPart],
    omitted: Sequence[OmittedTerm],
    options: FitOptions,
    progress: Callable[[float], None],
    checkpoint: Checkpoint | None,
) -> tuple[Sample | None, dict[str, Array]]:
    """The chain, if requested, and draws that include the non-identifiable directions."""

    def opened(draws: dict[str, Array]) -> dict[str, Array]:
        draws = with_omitted_drawn(draws, posterior.fit, omitted, options.seed)
        draws = with_scale_drawn(draws, posterior.fit, options.seed)
        return with_linear_parts_drawn(draws, lines, options.seed)

    if not options.posterior:
        return None, opened(normal_draws(posterior, options.seed))
    effort = EFFORTS[options.effort]
    chain = sample(
        posterior,
        options.seed,
        most_steps=effort.steps,
        work=effort.sampling,
        progress=progress,
        checkpoint=checkpoint,
    )
    if lines or omitted or posterior.fit.simulator.model.unlogged.is_relative:
        draws = opened({name: chain.chain[:, :, k] for k, name in enumerate(chain.names)})
        units = (*chain.units, *(line.unit for line in lines))
        values = np.stack(list(draws.values()), axis=2)
        chain = replace(chain, chain=values, names=tuple(draws), units=units)
    return chain, chain.draws()


def _declared_draws(
    declared: Fit, outcome: Outcome | None, draws: dict[str, Array], options: FitOptions
) -> dict[str, Array]:
    """Draws from the nominal model's posterior; those of the final model if it has no effects."""
    if outcome is None or not outcome.effects:
        return draws
    draws = normal_draws(Posterior(declared, effective_fraction(declared)), options.seed)
    return _within_signs(with_scale_drawn(draws, declared, options.seed))


def _within_signs(draws: dict[str, Array]) -> dict[str, Array]:
    """Draws with the signs of a physical motor; the loop would reject others as invalid input.

    A parameter that the runs hardly determine, as with a reversed sensor, has draws at its bound of
    0, where rounding decides the sign.

    Raises:
        ComputationError: A draw is infinite or NaN.
    """
    beyond = [name for name in _SIGNED if not np.isfinite(draws.get(name, 0.0)).all()]
    if beyond:
        raise ComputationError(
            f"the posterior of {', '.join(beyond)} has no end: the runs determine no motor; check "
            "the largest values of each channel, and their units"
        )
    return draws | {name: np.abs(draws[name]) for name in _SIGNED if name in draws}


def _suspects(runs: Sequence[Run]) -> str:
    """Input warnings that may explain why there is no result; empty if there are none."""
    found = [str(w) for code in _SUSPECT for run in runs for w in run.warnings if w.code == code]
    if not found:
        return ""
    more = f" ({len(found) - 1} more such remarks)" if len(found) > 1 else ""
    return f"; what was noticed in the runs may be why: {found[0]}{more}"
