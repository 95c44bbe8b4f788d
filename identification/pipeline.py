"""Identification pipeline from runs to a result; the only module that orders the stages.

    identification = identify(training, validation)
    identification.result["parameters"]["Ra25"]["median"]
    identification.write(Path("out"))

The stages are checks, nominal fit, effect search, posterior, feedback metrics and report.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from identification.checks.campaign import Admission, admitted, suspects
from identification.checks.values import check_values
from identification.diagnosis.localise import Localisation, localise
from identification.effects.catalogue import CATALOGUE
from identification.errors import ComputationError, InputError, OptionError
from identification.fit.campaign import Campaign, campaign_of
from identification.fit.declared import fit_declared
from identification.fit.effective_samples import effective_fraction, scattered_fraction
from identification.fit.gains import GainRatio, current_gains, with_one_gain
from identification.fit.knowledge import Knowledge
from identification.fit.noise import with_noise_model
from identification.fit.solve import Fit
from identification.fit.voltage import with_smooth_voltage
from identification.identified import Identified
from identification.ingest.given import RunLike, runs_of
from identification.ingest.run import Run
from identification.options import EFFORTS, FitOptions
from identification.posterior.checkpoint import Checkpoint
from identification.posterior.density import Posterior
from identification.posterior.draws import final_draws, nominal_draws
from identification.reporting.files import write_chain, write_outputs
from identification.result.content import assemble
from identification.result.findings import Findings, ResidualAnalysis
from identification.selection.confounded import confounded_terms, unresolved_transients
from identification.selection.curve_detail import curve_details
from identification.selection.long import search_long
from identification.selection.non_identifiable import (
    collinear_sizes,
    linear_parts_of,
    with_linear_parts,
)
from identification.selection.omitted import OmittedTerm, unknown_gain
from identification.selection.outcome import Outcome
from identification.selection.reference_run import reference_runs
from identification.selection.sample_times import sample_time_errors
from identification.selection.sharpening import with_sharp_friction
from identification.selection.thermometer import thermometer_errors
from identification.selection.uneven import uneven_residual
from identification.selection.voltage_errors import voltage_errors
from identification.speed_loop import feedback_metrics, parse_controllers, suited_controller
from identification.speed_loop.nonlinear import simulated_loops
from identification.threads import repeatable_algebra
from identification.work import metered, was_interrupted

if TYPE_CHECKING:
    import control

__all__ = ["FitOptions", "Identification", "Progress", "identify"]

Progress = Callable[[str, float], None]
"""Called with the name of the stage and the completed fraction of the whole job."""


@dataclass(frozen=True, repr=False)
class Identification(Identified):
    """Result of the identification of a campaign."""

    result: dict[str, Any]
    findings: Findings

    def draws(self) -> dict[str, NDArray[np.float64]]:
        """(n_draw,) draws of each parameter of the final model, in its unit."""
        return self.findings.draws

    @contextmanager
    def posterior_file(self) -> Iterator[Path]:
        """A temporary posterior.nc.

        Raises:
            InputError: The posterior was not sampled.
        """
        with TemporaryDirectory() as directory:
            path = Path(directory) / "posterior.nc"
            if not write_chain(path, self.result, self.findings):
                raise InputError("the posterior was not sampled; identify with posterior=True")
            yield path

    def write(self, directory: str | os.PathLike[str]) -> None:
        """Write result.json, report.html and, where sampled, posterior.nc into `directory`.

        Every file appears complete or not at all.
        """
        write_outputs(Path(directory), self.result, self.findings)

    def transfer_function(self, temperature: float) -> control.TransferFunction:
        """Transfer function of python-control from voltage [V] to speed [rad/s].

        Args:
            temperature: Temperature of winding and magnet [degC].

        Raises:
            OptionError: python-control is not installed, or the temperature is not accepted.
        """
        # Lazy import, here and below: the exports are no part of an identification.
        from identification.export.linear import transfer_function

        return transfer_function(self.result, temperature)

    def state_space(self, temperature: float, samples: int = 0) -> list[control.StateSpace]:
        """State spaces of python-control: of the best values, then of samples of the posterior.

        The inputs are voltage [V] and load torque [N m], the outputs current and speed.

        Args:
            temperature: Temperature of winding and magnet [degC].
            samples: Number of samples.

        Raises:
            OptionError: python-control is not installed, or the temperature is not accepted.
        """
        from identification.export.linear import state_space

        count = next(iter(self.findings.draws.values())).size
        kept = np.unique(np.linspace(0, count - 1, samples).astype(int))
        draws = {name: values[kept] for name, values in self.findings.draws.items()}
        return state_space(self.result, temperature, draws if samples else None)


# A candidate that overflows has an infinite cost and is rejected; numpy warnings add nothing.
@np.errstate(all="ignore")
def identify(
    training: RunLike | Iterable[RunLike],
    validation: RunLike | Iterable[RunLike] = (),
    options: FitOptions = FitOptions(),  # noqa: B008  frozen
    progress: Progress | None = None,
    checkpoint: Checkpoint | None = None,
    withheld: Collection[str] = (),
) -> Identification:
    """Identify one motor from its runs.

    Args:
        training: Runs to fit, paths of run files or DataFrames, in the order in which they were
            recorded, or a single one.
        validation: Validation runs, in the same forms; they are never fitted.
        options: Options of the user.
        progress: Called with the progress of the job.
        checkpoint: Where the chain of the posterior is saved, so that the same job can resume it.
        withheld: Effect types that the search must not add, to measure their contribution.

    Raises:
        InputError: There are too few samples, the runs contradict physics or each other, or an
            option is invalid.
        ComputationError: No model can be simulated over the runs.
    """
    if not isinstance(options, FitOptions):
        raise InputError(
            f"options is a {type(options).__name__}; expected FitOptions, as in FitOptions(seed=1)"
        )
    fitted, unseen = runs_of(training, "training"), runs_of(validation, "validation")
    try:
        with metered(_limit(options.time_limit)), repeatable_algebra():
            admission = _admitted(fitted, unseen, options, withheld)
            found = _identified(admission, options, progress, checkpoint, withheld)
    except ComputationError as error:
        raise ComputationError(f"{error}{suspects([*fitted, *unseen])}") from error
    if progress is not None:
        progress("done", 1.0)
    return found


def _limit(seconds: float | None) -> Callable[[], bool] | None:
    """Function that returns whether the time limit has passed; None without a limit."""
    if seconds is None:
        return None
    until = time.monotonic() + seconds
    return lambda: time.monotonic() > until


def _identified(
    admission: Admission,
    options: FitOptions,
    progress: Progress | None,
    checkpoint: Checkpoint | None,
    withheld: Collection[str],
) -> Identification:
    tell = progress or (lambda stage, fraction: None)
    tell("fit", 0.0)
    campaign, declared, gains = _nominal(admission, options)
    knowledge = Knowledge(options.priors, options.plate.friction).beside(declared)
    # Known values are tested again at the end: an effect may resolve a contradiction.
    declared, _ = knowledge.joined_to(declared)
    found, outcome = _searched(declared, campaign, options, tell, withheld)
    tell("fit", 0.5)
    closed = with_noise_model(outcome.fit if outcome else declared)
    closed, contradicted = knowledge.joined_to(closed)
    opened = with_linear_parts(closed)
    final = closed if opened is closed else with_noise_model(opened)
    fraction = min(effective_fraction(closed), scattered_fraction(closed))
    changed = outcome is not None and bool(outcome.effects)
    left = localise(final) if found and changed else found
    analysis = ResidualAnalysis(campaign, declared, final, outcome, left)
    omitted = (
        *_omitted(closed, fraction, declared, outcome, gains),
        *(analysis.judged.doubtful if analysis.judged else ()),
    )
    last = "posterior" if options.posterior else "intervals"
    tell(last, 0.55)
    runs = (*admission.training, *admission.validation)
    chain, draws = final_draws(
        Posterior(closed, fraction, outcome.smooth if outcome else None),
        linear_parts_of(final),
        omitted,
        options,
        lambda done: tell(last, 0.55 + 0.3 * done),
        checkpoint and checkpoint.about([run.sha256 for run in runs], options),
    )
    tell("feedback", 0.85)
    loops = options.temperatures, options.controllers
    declared_draws = nominal_draws(declared, options.seed) if changed else draws
    tell("report", 0.9)
    findings = Findings(
        analysis=analysis,
        admission=admission,
        options=options,
        declared_draws=declared_draws,
        fraction=fraction,
        draws=draws,
        sample=chain,
        feedback=feedback_metrics(draws, *loops),
        omitted=omitted,
        feedback_before=feedback_metrics(declared_draws, *loops) if changed else [],
        suited=suited_controller(draws, campaign.sample_interval),
        loops=tuple(simulated_loops(final, draws, *loops)),
        localisation=found,
        interrupted=was_interrupted(),
        contradicted=contradicted,
    )
    return Identification(assemble(findings), findings)


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
    return found, with_sharp_friction(outcome, campaign, withheld)


def _admitted(
    training: Sequence[Run],
    validation: Sequence[Run],
    options: FitOptions,
    withheld: Collection[str],
) -> Admission:
    """The runs to fit, after all checks that need no fit."""
    check_values(training, validation)
    for kind in withheld:
        if kind not in CATALOGUE:
            raise OptionError(
                f"withheld has the kind {kind!r}; expected kinds of {', '.join(CATALOGUE)}",
                value=kind,
            )
    parse_controllers(options.controllers)
    return admitted(training, validation, options)


def _omitted(
    final: Fit, fraction: float, declared: Fit, outcome: Outcome | None, gains: Sequence[GainRatio]
) -> tuple[OmittedTerm, ...]:
    """Terms that are not in the model and could change its parameters."""
    before = declared if outcome and outcome.effects else None
    unexplained = outcome.omitted if outcome else ()
    return (
        *unknown_gain(final, [gain.ratio for gain in gains]),
        *unexplained,
        *confounded_terms(
            outcome.fit if outcome else declared, before, is_structured=bool(unexplained)
        ),
        *thermometer_errors(final, fraction),
        *collinear_sizes(final),
        *curve_details(final, fraction),
        *voltage_errors(final, fraction),
        *unresolved_transients(final, fraction),
        *uneven_residual(final, fraction),
        *sample_time_errors(final, fraction),
        *reference_runs(final),
    )


def _nominal(
    admission: Admission, options: FitOptions
) -> tuple[Campaign, Fit, tuple[GainRatio, ...]]:
    """Records, fit of the nominal model, and runs whose current was logged with another gain."""
    campaign = campaign_of(admission.training, admission.validation)
    declared = _declared(campaign, options)
    campaign, declared = with_smooth_voltage(campaign, declared, options.hold)
    gains = current_gains(declared, campaign)
    if gains:
        campaign = with_one_gain(campaign, gains)
        declared = fit_declared(campaign.training, declared.simulator.model.hold)
    return campaign, declared, gains


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
