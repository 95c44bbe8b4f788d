"""Result entries and warnings on omitted terms and on effects confounded with a parameter."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from identification.fit.identifiability import identified
from identification.fit.solve import Fit
from identification.quantities import DECLARED_PARAMETERS
from identification.selection.confounded import turns_one_way
from identification.selection.omitted import OmittedTerm, consider_variances

__all__ = ["confounded_entries", "confounded_warnings", "omitted_entries", "omitted_warnings"]

_NAMED = 4
_ONE_TORQUE = ("coulomb_friction", "load_torque")


def omitted_entries(final: Fit, omitted: Sequence[OmittedTerm]) -> list[dict[str, Any]]:
    """Result entry of each omitted term: predicted gain, and parameter changes it could cause.

    Args:
        final: Fit of the final model.
        omitted: The terms.
    """
    return [
        {
            "name": term.name,
            "promised_log_likelihood_gain": term.gain,
            "log_likelihood_gain_by_chance": term.chance,
            "changes": _changes(final, term),
        }
        for term in omitted
        if not term.parameter
    ]


def confounded_entries(final: Fit, omitted: Sequence[OmittedTerm]) -> list[dict[str, Any]]:
    """Result entry of each effect that is confounded with a parameter.

    Args:
        final: Fit of the final model.
        omitted: Terms that could change its parameters.
    """
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


def confounded_warnings(final: Fit, share: float, omitted: Sequence[OmittedTerm]) -> list[str]:
    """Warnings on parameters that are identifiable only if a confounded effect is absent.

    Args:
        final: Fit of the final model.
        share: Effective sample fraction.
        omitted: Terms that could change its parameters.
    """
    known = identified(final, share)
    messages = [
        _confounded(final, term)
        for term in omitted
        if term.parameter
        and known[term.parameter]
        and not identified(final, share, consider_variances(final, [term]))[term.parameter]
    ]
    torques = [term.name for term in final.simulator.model.terms if term.name in _ONE_TORQUE]
    if torques and turns_one_way(final.simulator.records):
        messages.append(
            f"the motor turns in one direction only, where dry friction and a load torque are one "
            f"constant torque: {' and '.join(torques)} may be either, or both; record runs in both "
            "directions to tell them apart"
        )
    return messages


def _confounded(final: Fit, term: OmittedTerm) -> str:
    """Warning on one confounded parameter: the alternative, and the measurement that decides."""
    values = dict(zip(final.coordinates.names, final.values, strict=True))
    name = term.parameter
    there = dict(zip(final.coordinates.names, final.position, strict=True))
    moved = np.array([there[key] + term.steps.get(key, 0.0) for key in final.coordinates.names])
    low = final.coordinates.values(np.clip(moved, final.coordinates.lower, np.inf))
    less = float(low[final.coordinates.names.index(name)])
    factor, unit = (1e3, "mH") if name == "L" else (1.0, DECLARED_PARAMETERS[name].unit)
    says = f"{name} is {factor * values[name]:.3g} {unit} only if there is no"
    is_better = term.time is not None and (term.gain or 0.0) > (term.chance or 0.0)
    says_so = "the runs are explained better by" if is_better else "the runs do not exclude"
    found = f"{says_so} {name} = {factor * less:.3g} {unit}"
    if term.time is not None:
        found += f" with a time constant of {1e3 * term.time:.3g} ms in the sensor"
    if name == "L":
        lag = 1e3 * values["L"] / values["Ra25"]
        return (
            f"{says} lag in the current sensor ({term.name}): the lag of {lag:.3g} ms in the "
            f"current is that of L or of the sensor, and {found}; measure L, as with an LCR meter, "
            "and give --known L=VALUE, or log the current without its filter and at a higher rate"
        )
    if name == "J":
        return (
            f"{says} lag in the speed sensor ({term.name}): {found}; give --known J=VALUE, or log "
            "the speed without its filter"
        )
    return (
        f"{says} dry friction or load torque: the motor turns in one direction only, where a "
        f"constant torque and b w look alike, and {found}; record runs in both directions and at "
        "several speeds, or give --known b=VALUE"
    )


def omitted_warnings(final: Fit, omitted: Sequence[OmittedTerm]) -> list[str]:
    """Warning on unexplained structure in the residual, and on its effect on the intervals.

    Args:
        final: Fit of the final model.
        omitted: The terms.
    """
    # An unknown sensor gain (a term without a predicted gain) is reported where it is detected.
    omitted = [term for term in omitted if term.gain is not None and not term.parameter]
    if not omitted:
        return []
    spread = np.sqrt(consider_variances(final, omitted)) * final.coordinates.slopes(final.position)
    shares = {
        name: float(sd / abs(value))
        for name, sd, value in zip(final.coordinates.names, spread, final.values, strict=True)
        if name in DECLARED_PARAMETERS and value != 0.0
    }
    most = max(shares, key=lambda name: shares[name])
    names = ", ".join(term.name for term in omitted[:_NAMED])
    names += f" and {len(omitted) - _NAMED} more" if len(omitted) > _NAMED else ""
    return [
        "the residual holds structure that no effect explains: adding a term would improve the fit "
        f"by more than chance, but none passes the acceptance criteria ({names}); the intervals "
        "include what such a term could change, which is most for "
        f"{most}: {100 * shares[most]:.3g} % of its value (one standard deviation)"
    ]
