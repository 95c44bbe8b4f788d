"""Result entries and warnings on omitted terms and on effects confounded with a parameter."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from identification.effects.effect import effects_of
from identification.fit.identifiability import identified
from identification.fit.solve import Fit
from identification.quantities import DECLARED_PARAMETERS
from identification.result.effect_texts import effect_words
from identification.result.numbers import percent_text, probability_text
from identification.selection.confounded import turns_one_way
from identification.selection.non_identifiable import linear_parts_of
from identification.selection.omitted import OmittedTerm, consider_variances
from identification.selection.reference_run import REFERENCE_RUN
from identification.selection.sample_times import SAMPLE_TIMES, time_deviations
from identification.selection.uneven import UNEVEN
from identification.surrogates.gain import RelativeChange
from identification.warning import ResultWarning

__all__ = [
    "confounded_entries",
    "confounded_warnings",
    "omitted_entries",
    "omitted_warnings",
    "sample_time_warnings",
    "surrogate_warnings",
    "undetermined_warnings",
]

_NAMED = 4
_MORE_PROBABLE = 0.5
_ONE_TORQUE = ("coulomb_friction", "load_torque")


def omitted_entries(final: Fit, omitted: Sequence[OmittedTerm]) -> list[dict[str, Any]]:
    """Result entry of each omitted term: predicted gain, and parameter changes it could cause."""
    return [
        {
            "name": term.name,
            "promised_log_likelihood_gain": term.gain,
            "log_likelihood_gain_by_chance": term.chance,
            "share": term.share,
            "changes": _changes(final, term),
        }
        for term in omitted
        if not term.parameter
    ]


def confounded_entries(final: Fit, omitted: Sequence[OmittedTerm]) -> list[dict[str, Any]]:
    """Result entry of each effect that is confounded with a parameter."""
    return [
        {
            "name": term.name,
            "parameter": term.parameter,
            "log_likelihood_gain": term.gain,
            "log_likelihood_loss_limit": term.chance,
            "time_constant_s": term.time,
            "changes": _changes(final, term),
        }
        for term in omitted
        if term.parameter
    ]


def _changes(final: Fit, term: OmittedTerm) -> dict[str, float]:
    """Change of each nominal-model parameter caused by a term [its unit]."""
    slopes = dict(
        zip(final.coordinates.names, final.coordinates.slopes(final.position), strict=True)
    )
    return {name: float(term.steps.get(name, 0.0) * slopes[name]) for name in DECLARED_PARAMETERS}


def confounded_warnings(
    final: Fit, share: float, omitted: Sequence[OmittedTerm]
) -> list[ResultWarning]:
    """Warnings on parameters that are identifiable only if a confounded effect is absent."""
    known = identified(final, share)
    warnings = [
        _confounded(final, term)
        for term in omitted
        if term.parameter
        and known[term.parameter]
        and not identified(final, share, consider_variances(final, [term]))[term.parameter]
    ]
    torques = [term.name for term in final.simulator.model.terms if term.name in _ONE_TORQUE]
    if torques and turns_one_way(final.simulator.records):
        message = (
            "the motor turns in one direction only, so Coulomb friction and a load torque are the "
            f"same constant torque: {' and '.join(torques)} may be either, or the sum of both"
        )
        fix = "record runs in both directions to separate them"
        warnings.append(ResultWarning("one_direction", "warning", message, fix))
    return warnings


def _confounded(final: Fit, term: OmittedTerm) -> ResultWarning:
    """Warning on one confounded parameter: the alternative, and the measurement that decides."""
    values, name = final.by_name, term.parameter
    if name not in DECLARED_PARAMETERS:
        return _collinear(final, term)
    there = dict(zip(final.coordinates.names, final.position, strict=True))
    moved = np.array([there[key] + term.steps.get(key, 0.0) for key in final.coordinates.names])
    low = final.coordinates.values(np.clip(moved, final.coordinates.lower, np.inf))
    less = float(low[final.coordinates.names.index(name)])
    factor, unit = (1e3, "mH") if name == "L" else (1.0, DECLARED_PARAMETERS[name].unit)
    value = f"{factor * values[name]:.3g} {unit}"
    is_better = term.time is not None and (term.gain or 0.0) > (term.chance or 0.0)
    verdict = "the runs fit better with" if is_better else "the runs do not exclude"
    found = f"{verdict} {name} = {factor * less:.3g} {unit}"
    if term.time is not None:
        found += f" and a sensor time constant of {1e3 * term.time:.3g} ms"
    if name == "L":
        lag = 1e3 * values["L"] / values["Ra25"]
        message = (
            f"L is confounded with a lag of the current sensor ({term.name}): without such a lag, "
            f"L is {value} (L / Ra = {lag:.3g} ms), but {found}"
        )
        fix = (
            "measure L with an LCR meter and give --known L=VALUE, or log the unfiltered current "
            "at a higher sample rate"
        )
    elif name == "J":
        message = (
            f"J is confounded with a lag of the speed sensor ({term.name}): without such a lag, J "
            f"is {value}, but {found}"
        )
        fix = "give --known J=VALUE, or log the unfiltered speed"
    else:
        message = (
            "b is confounded with Coulomb friction and load torque, because the motor turns in one "
            f"direction only: without them, b is {value}, but {found}"
        )
        fix = "record runs in both directions and at several speeds, or give --known b=VALUE"
    return ResultWarning("confounded_parameter", "warning", message, fix, "known")


def _collinear(final: Fit, term: OmittedTerm) -> ResultWarning:
    """Warning on the size of an effect that is collinear with the curve of the model."""
    effect, _, own = term.parameter.partition(".")
    k = final.coordinates.names.index(term.parameter)
    size = f"{final.values[k]:.3g} {final.coordinates.parameters[k].unit}"
    (curve,) = (one for one in effects_of(final.simulator.model.terms) if one.name == term.name)
    message = (
        f"{own} of {effect_words(effect)} is collinear with the {curve.variant}: only their "
        f"sum is determined, and the {size} may be a part of the curve"
    )
    fix = "measure that effect alone, for example friction in a run without load"
    return ResultWarning("confounded_parameter", "warning", message, fix)


def omitted_warnings(final: Fit, omitted: Sequence[OmittedTerm]) -> list[ResultWarning]:
    """Warnings on unexplained structure in the residual, and on its effect on the intervals."""
    warnings = [*_reference_warnings(final, omitted), *_uneven_warnings(final, omitted)]
    # An unknown sensor gain (a term without a predicted gain) is reported where it is detected.
    omitted = [term for term in omitted if term.gain is not None and not term.parameter]
    if not omitted:
        return warnings
    names = _named([term.name for term in omitted])
    message = (
        "the residual holds structure that no effect explains: adding a term would improve the fit "
        f"by more than chance, but none passes the acceptance criteria ({names}); the intervals "
        f"include what such a term could change, which is most for {_most_changed(final, omitted)}"
    )
    return [ResultWarning("omitted_terms", "warning", message), *warnings]


def sample_time_warnings(
    final: Fit, fraction: float, omitted: Sequence[OmittedTerm]
) -> list[ResultWarning]:
    """Warning on samples that were taken before or after their logged times."""
    terms = [term for term in omitted if term.name == SAMPLE_TIMES]
    if not terms:
        return []
    channels = zip(("current", "speed"), time_deviations(final, fraction), strict=True)
    errors = [f"{1e3 * s:.2g} ms in the {name}" for name, s in channels if s > 0.0]
    message = (
        "samples were taken before or after their logged times: the residual grows with the slope "
        f"of the signal (time errors of {' and '.join(errors)}, one standard deviation), so a "
        "delay may be an artefact; the intervals include the mean error at steps of the voltage, "
        f"which is most for {_most_changed(final, terms)}"
    )
    fix = "log the time of each sample, or let a timer in hardware start the conversions"
    return [ResultWarning("sample_times", "warning", message, fix)]


def _reference_warnings(final: Fit, omitted: Sequence[OmittedTerm]) -> list[ResultWarning]:
    """Warning on a value that runs differ in, of which the first run may not have the usual one."""
    terms = [term for term in omitted if term.name == REFERENCE_RUN]
    if not terms:
        return []
    differing = [
        effect.variant
        for effect in effects_of(final.simulator.model.terms)
        if isinstance(effect, RelativeChange)
    ]
    message = (
        f"the runs differ ({'; '.join(differing)}), and which of them have the usual value is "
        "unknown; the intervals include the difference, which is most for "
        f"{_most_changed(final, terms)}"
    )
    fix = "find out which run has the usual value, or give --known NAME=VALUE"
    return [ResultWarning("reference_run", "warning", message, fix)]


def _uneven_warnings(final: Fit, omitted: Sequence[OmittedTerm]) -> list[ResultWarning]:
    """Warning on a residual that is larger where it determines certain parameters."""
    uneven = [term for term in omitted if term.name == UNEVEN]
    if not uneven:
        return []
    message = (
        "the residual is larger in the samples that determine certain parameters than in the "
        "others; the intervals include its scatter there, which is most for "
        f"{_most_changed(final, uneven)}"
    )
    fix = "record more steps of the voltage, and check that no command takes effect late"
    return [ResultWarning("uneven_residual", "warning", message, fix)]


def surrogate_warnings(final: Fit, omitted: Sequence[OmittedTerm]) -> list[ResultWarning]:
    """Warning on effects that are more probably surrogates for a term outside the catalogue."""
    surrogates = [term for term in omitted if (term.surrogate or 0.0) > _MORE_PROBABLE]
    if not surrogates:
        return []
    names = _named([f"{term.name} ({probability_text(1.0 - term.share)})" for term in surrogates])
    message = (
        "the model leaves more than noise, so it is improbable that the motor has the effects "
        f"{names}; the intervals include the parameters of the model without each of them, which "
        f"change most for {_most_changed(final, surrogates)}"
    )
    return [ResultWarning("improbable_effects", "warning", message)]


def _named(names: Sequence[str]) -> str:
    """The first of the names, and the number of the others."""
    others = f" and {len(names) - _NAMED} more" if len(names) > _NAMED else ""
    return ", ".join(names[:_NAMED]) + others


def _most_changed(final: Fit, omitted: Sequence[OmittedTerm]) -> str:
    """Parameter that the terms change most in relation to its value, and this change."""
    spread = np.sqrt(consider_variances(final, omitted)) * final.coordinates.slopes(final.position)
    shares = {
        name: float(sd / abs(value))
        for name, sd, value in zip(final.coordinates.names, spread, final.values, strict=True)
        if name in DECLARED_PARAMETERS and value != 0.0
    }
    most = max(shares, key=lambda name: shares[name])
    return f"{most}: {percent_text(shares[most])} of its value (one standard deviation)"


def undetermined_warnings(final: Fit, known: Mapping[str, bool]) -> list[ResultWarning]:
    """Warning on the parameters that the runs do not determine; `known` is True for the others."""
    # The linear part of a curve is reported under the parameter it is collinear with.
    lines = {line.name for line in linear_parts_of(final)}
    lines |= {parameter.name for parameter in final.simulator.model.unlogged.parameters}
    unknown = [name for name, found in known.items() if not found and name not in lines]
    if not unknown:
        return []
    message = (
        f"the runs do not determine {', '.join(unknown)}: the intervals are wide and come mainly "
        "from the general priors; the table of parameters in the report gives the reasons"
    )
    return [ResultWarning("parameters_not_identified", "warning", message)]
