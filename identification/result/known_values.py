"""Result entries and warnings on known values (priors)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Final

from identification.checks.finding import factor
from identification.fit.identifiability import identified
from identification.fit.knowledge import LIMIT, Comparison
from identification.fit.solve import Fit
from identification.ingest.run import Run
from identification.ingest.units import CHANNEL_QUANTITIES, UNITS
from identification.known import Prior
from identification.nameplate import NAMEPLATE
from identification.result.entries import ORIGINS
from identification.warning import Option, ResultWarning

__all__ = ["contradiction_warning", "known_only_warnings", "prior_entries"]

_CLOSE: Final = 0.4
"""Tolerance of a log ratio around the factor of a unit: two standard deviations of a nameplate
value."""
_ON_PLATES: Final = ("rpm", "mA")
_SHOWN_BY: Final = {"Kt25": "speed_rad_s", "Ra25": "current_A"}
"""Channel whose unit scales a parameter: with the speed in rpm, Kt comes out 9.55 times smaller."""


def prior_entries(
    fit: Fit, share: float, priors: Sequence[Prior], contradicted: Sequence[Comparison]
) -> dict[str, dict[str, Any]]:
    """Member ``prior`` of each parameter that has one, by name."""
    entries: dict[str, dict[str, Any]] = {}
    by_runs = identified(fit, share, by_runs=True)
    given = {prior.name: prior for prior in (*priors, *(one.prior for one in contradicted))}
    for parameter in fit.coordinates.parameters:
        name, origin = parameter.name, parameter.origin
        if origin and name not in given:
            sd = parameter.prior_sd * parameter.scale
            given[name] = Prior(name, parameter.prior_mean, sd, origin)
        if name in given:
            entries[name] = {
                "prior": {
                    "value": given[name].value,
                    "sd": given[name].sd,
                    "origin": given[name].origin,
                    "used": bool(origin),
                    "identified_by_runs": by_runs[name],
                }
            }
    return entries


def known_only_warnings(fit: Fit, share: float) -> list[ResultWarning]:
    """Warnings on parameters that only known values identify."""
    together, by_runs = identified(fit, share), identified(fit, share, by_runs=True)
    names: dict[str, list[str]] = {}
    for parameter in fit.coordinates.parameters:
        if parameter.origin and together[parameter.name] and not by_runs[parameter.name]:
            names.setdefault(parameter.origin, []).append(parameter.name)
    return [
        ResultWarning(
            "known_value_only",
            "note",
            f"{', '.join(own)}: from {ORIGINS[origin]}, not from the runs",
        )
        for origin, own in names.items()
    ]


def contradiction_warning(one: Comparison, run: Run) -> ResultWarning:
    """Warning on an unused known value, with the estimate from the runs and a likely cause.

    The text names the columns of the first run, which are those of all runs logged in the same way.
    """
    prior = one.prior
    given = f"{prior.value:.4g} {prior.unit} (sd {prior.sd:.2g})"
    if (prior.name, prior.origin) == ("b", NAMEPLATE):
        given = f"at most {prior.value:.4g} {prior.unit}"
    apart = (
        f"the difference is {abs(one.distance):.3g} combined standard deviations (limit "
        f"{LIMIT:.2g})"
    )
    if one.unfitted:
        apart = "no fit with it and the other known values succeeded"
    message = (
        f"{prior.name} is {given} by {ORIGINS[prior.origin]}, but "
        f"{one.estimate:.4g} {prior.unit} (sd {one.sd:.2g}) by the runs; {apart}; the fit did not "
        "use the given value"
    )
    lag = "a filter or delay of the current sensor also increases the estimated L"
    lags = [lag] if prior.name == "L" and one.estimate > prior.value else []
    units = _units(one, run)
    option: Option | None = "map" if any("--map" in text for text in units) else None
    fix = "; ".join(["check it", *lags, *units])
    return ResultWarning("known_value_contradicted", "warning", message, fix, option)


def _units(one: Comparison, run: Run) -> list[str]:
    """Unit whose factor explains the difference from the known value, and its correction."""
    channel = _SHOWN_BY.get(one.prior.name)
    if channel is None or not one.estimate > 0.0:
        return []
    ratio = math.log(one.estimate / one.prior.value)
    quantity = CHANNEL_QUANTITIES[channel]
    found = []
    for unit in UNITS:
        if unit.quantity != quantity or unit.factor == 1.0:
            continue
        words = factor(run, channel, unit.factor).removeprefix(f"{run.name}:")
        logged = f"if {channel} is in {unit.name} in the runs, correct it with --map '{words}'"
        found.append((abs(ratio - math.log(unit.factor)), logged))
        if one.prior.origin == NAMEPLATE and unit.name in _ON_PLATES:
            typed = f"if a {quantity} of the nameplate is in {unit.name}, append {unit.name} to it"
            found.append((abs(ratio + math.log(unit.factor)), typed))
    off, sentence = min(found)
    return [sentence] if off < _CLOSE else []
