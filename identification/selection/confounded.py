"""Consider covariance for lags, friction and transients that are confounded with L, J and b.

A lag of the logged current is that of the winding, L / Ra, or that of the current sensor,

    i(s) / v(s) = 1 / (Ra (1 + s L/Ra)) 1 / (1 + s tau)     at nearly constant speed.

Exchanging the two factors leaves the current unchanged; only the speed, which follows the true
current, distinguishes them.  The same holds for the inertia and a filter of the speed and, if the
motor turns in one direction only, for viscous friction and a constant torque.  A search that
selects no such effect has not excluded it.

*Near.* A small lag, or a friction, of free amplitude is fitted together with the parameters to
first order.  The covariance of the parameters grows by (Schur complement)

    m m' / (d_perp' W d_perp + 1 / s^2)

where m is the step of the parameters that accompanies the effect, d_perp the part of its response
that the parameters cannot reproduce, and s the amplitude at which it causes the whole lag or
friction.  On a representative subset, the information is multiplied by the ratio of all samples to
those of the subset.

*Swapped.* The sensor gets nearly the whole lag, or the constant torque nearly the whole friction,
and all parameters are fitted from there.  With a small dry friction a shaft at rest creeps and with
the whole one it sticks, so that the two optima are apart.  If the log likelihood falls by less than
the limit, the runs do not exclude this optimum.  With its loss d and its parameter step m, the
covariance grows by m m' / max(2 d, 1).  An optimum that the subset of long records excludes counts
as excluded.  Any other is refitted to all samples, up to 100,000 of them, until a step gains less
than 1 below the limit; the loss is then that of the optimum that the next step predicts.  If the
residual has structure, the limit grows with the samples as the loss does, so that all samples say
no more than the subset, and its loss is scaled by the ratio of samples.

Source: Schmidt, in Advances in Control Systems 3 (1966), 293-340 (consider covariance); Venzon and
Moolgavkar, Applied Statistics 37 (1988), 87-94 (profile likelihood); Wilks, Annals of Mathematical
Statistics 9 (1938), 60-62 (distribution of the loss).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from identification.arrays import Array
from identification.effects.effect import AbstractEffect, Candidate
from identification.effects.friction import CoulombFriction
from identification.effects.parameters import columns, one_sign
from identification.effects.sensor import ChannelDelay, CurrentFilter, SpeedFilter
from identification.fit.effective_samples import effective_fraction
from identification.fit.identifiability import identified
from identification.fit.solve import Fit, TerminationLimits, continued, solve
from identification.model.excitation import Record, sample_interval
from identification.model.parameter import Coordinates
from identification.selection.candidates import scales_of
from identification.selection.omitted import OmittedTerm
from identification.selection.policy import DEFAULT
from identification.selection.refit import refitted_with
from identification.selection.screen import screened
from identification.selection.start import Along, Start
from identification.selection.subset import fitted_to, subset_of_fit

__all__ = ["confounded_terms", "turns_one_way", "unresolved_transients"]


@dataclass(frozen=True)
class _Rival:
    """An effect that is confounded with a parameter."""

    parameter: str
    small: Candidate
    """Candidate with one prototype of small amplitude."""
    whole: float
    """Amplitude that causes all of the lag or friction, over that of the prototype [-]."""
    swapped: Array | None = None
    """(n_own,) parameters that cause nearly all of it, where a fit starts; None for no fit."""


@dataclass(frozen=True)
class _Final:
    """The selected model, with the limits of an exclusion; see `confounded_terms`."""

    fit: Fit
    fraction: float
    is_structured: bool

    def limit(self, fit: Fit) -> float:
        """Loss of log likelihood, on the records of a fit, that excludes an optimum."""
        if not self.is_structured:
            return DEFAULT.exclusion_loss
        size = DEFAULT.least_fall * float(fit.weighting.counts.max()) * self.fraction
        return max(DEFAULT.exclusion_loss, size)

    def term(
        self, rival: _Rival, step: Array, gain: float, limit: float, time: float | None = None
    ) -> OmittedTerm:
        """The change, with the sign that lowers the parameter: a lag cannot be negative."""
        names = self.fit.coordinates.names
        sign = -1.0 if step[names.index(rival.parameter)] > 0.0 else 1.0
        steps = dict(zip(names, map(float, sign * step), strict=True))
        return OmittedTerm(rival.small.term.name, float(gain), limit, steps, rival.parameter, time)


def confounded_terms(
    final: Fit,
    nominal: Fit | None = None,
    *,
    is_structured: bool = False,
) -> tuple[OmittedTerm, ...]:
    """Effects that are confounded with parameters; for each parameter the one that lowers it most.

    Parameters that the user knows or that the runs do not determine are skipped, and so are effects
    that the model already has.

    If `final`, the selected model with white noise, has effects, `nominal` is the fit without them:
    a surrogate for a lag in `final` can prevent the fit from finding the lag itself.  If the
    residual `is_structured`, with structure that no effect explains, the model is wrong somewhere,
    and a loss excludes an optimum only if it is as large as the gain that the size criterion
    requires.
    """
    fraction = effective_fraction(final)
    known = identified(final, fraction)
    present = {term.name for term in final.simulator.model.terms}
    origins = {p.name: p.origin for p in final.coordinates.parameters}
    bases = [final] if nominal is None else [nominal, final]
    parts = [subset_of_fit(base) for base in bases]
    deviations = np.sqrt(np.diag(final.equations.covariance()) / fraction)
    least = dict(zip(final.coordinates.names, -DEFAULT.widening * deviations, strict=True))
    found: dict[str, OmittedTerm] = {}
    model = _Final(final, fraction, is_structured)
    for rival in _rivals(final):
        name = rival.parameter
        if not known[name] or origins[name] or rival.small.term.name in present:
            continue
        for term in (*_first_order(model, parts[-1], rival), *_swapped(model, parts, rival)):
            if term.steps[name] < least[name]:
                found[name], least[name] = term, term.steps[name]
    return tuple(found.values())


def turns_one_way(records: Sequence[Record]) -> bool:
    """True if the peak speed in one direction is at most a tenth of that in the other."""
    return one_sign(record.measured[:, 1] for record in records) != 0


def _rivals(fit: Fit) -> Iterator[_Rival]:
    """The confounded effects in their textbook forms."""
    scales = scales_of(fit)
    at = fit.by_name
    lag = at["L"] / at["Ra25"]
    delays = [c for c in ChannelDelay.candidates(scales) if c.term.variant == "current"]
    filters = CurrentFilter.candidates(scales)[0], SpeedFilter.candidates(scales)[0]
    yield _lagging("L", filters[0], lag, swaps=True)
    yield _lagging("L", delays[0], lag)
    # A logged current follows the true speed and so separates the motor's lag from the sensor's.
    is_unlogged = not fit.weighting.counts[0] > 0
    slow = at["J"] / (at["b"] + at["Kt25"] ** 2 / at["Ra25"])
    yield _lagging("J", filters[1], slow, swaps=is_unlogged)
    if turns_one_way(scales.records):
        friction = CoulombFriction.candidates(scales)[0]
        first = friction.starts[:, :1]
        whole = at["b"] * scales.speed / float(first[0, 0])
        nearly = first[:, 0].copy()
        nearly[0] *= (1.0 - DEFAULT.remaining_lag) * whole
        yield _Rival("b", Candidate(friction.term, first), whole, nearly)


def _lagging(name: str, lagging: Candidate, lag: float, *, swaps: bool = False) -> _Rival:
    """A sensor lag [s], the first parameter of its term, in place of the lag of the motor [s]."""
    own = lagging.term.parameters[0]
    shares = np.array([DEFAULT.small_lag, 1.0 - DEFAULT.remaining_lag])
    small, nearly = np.clip(shares * lag, 1.01 * own.lower, 0.99 * own.upper)
    small = max(float(small), 1e-3 * own.upper)
    candidate = Candidate(lagging.term, columns((small,)))
    return _Rival(name, candidate, max(lag / small, 1.0), np.array([nearly]) if swaps else None)


def _first_order(final: _Final, part: Fit, rival: _Rival) -> Iterator[OmittedTerm]:
    """First-order change by an effect of small, free amplitude."""
    fraction = final.fraction * (_rows(final.fit) / _rows(part))
    for score in screened(part, [rival.small]):
        if score.along is None or score.covariance is None:
            continue
        variance = float(score.covariance[0, 0])
        weight = float(np.sqrt(2.0 * score.gain * variance))
        if rival.small.term.parameters[0].vanishes:
            # The score has replaced a negative amplitude by that of the prototype.
            weight = float(score.start[0] / rival.small.starts[0, 0])
        if not weight > 0.0:
            continue
        size = 1.0 / np.sqrt(fraction / variance + 1.0 / max(rival.whole, 1e-9) ** 2)
        step = np.reshape(score.along.position, -1) / weight * size
        if np.isfinite(step).all():
            yield final.term(rival, step, fraction * score.gain, DEFAULT.exclusion_loss)


def _swapped(final: _Final, parts: Sequence[Fit], rival: _Rival) -> Iterator[OmittedTerm]:
    """Changes to optima that are not excluded and at which the sensor has most of the lag."""
    if rival.swapped is None:
        return
    fraction, whole, part = final.fraction, final.fit, parts[-1]
    for base in parts:
        values = base.values.copy()
        values[base.coordinates.names.index(rival.parameter)] *= DEFAULT.remaining_lag
        # Fitting the subset's noise gains 0.5 per parameter on average; allow twice that.
        limit = final.limit(part) + (0 if part is whole else part.position.size)
        limits = TerminationLimits(DEFAULT.steps, part.cost + limit / fraction)
        if part is not whole:
            base = _bounded(base, rival.parameter, DEFAULT.least_lag)  # noqa: PLW2901
            limits = replace(limits, sufficient=limits.abandon_cost)
        fit = _fitted_from(base, values, rival.small.term, rival.swapped, limits)
        loss = fraction * (fit.cost - part.cost)
        if not loss < limit:
            continue
        limit = final.limit(whole)
        if part is not whole:
            loss = fraction * (_least_cost(fit) - part.cost)
            fit = _moved(fit, part, whole)
            if final.is_structured:
                loss *= _rows(whole) / _rows(part)
            elif _rows(whole) <= DEFAULT.confirmed_samples:
                cost = whole.cost + limit / fraction
                limits = TerminationLimits(DEFAULT.steps, cost, sufficient=cost)
                fit = fitted_to(whole.simulator.records, fit, limits)
                loss = fraction * (_least_cost(fit) - whole.cost)
        if loss < limit:
            there = fit.by_name
            moved = whole.moved_to(there).position
            step = (moved - whole.position) / np.sqrt(max(2.0 * loss, 1.0))
            own = rival.small.term.parameters[0]
            time = None if own.vanishes else there[f"{rival.small.term.name}.{own.name}"]
            yield final.term(rival, step, -loss, limit, time)


def _bounded(fit: Fit, name: str, share: float) -> Fit:
    """The fit with a parameter bounded below by a share of its value.

    No run determines a lag far below the sample interval, so a fit can lower it without end, and
    the model becomes stiff.
    """
    parameters = [
        replace(p, lower=max(p.lower, share * fit.by_name[name])) if p.name == name else p
        for p in fit.coordinates.parameters
    ]
    return replace(fit, coordinates=Coordinates(parameters))


def _least_cost(fit: Fit) -> float:
    """Cost of the optimum of a fit, predicted by the next step if the fit ended before it."""
    if fit.converged:
        return fit.cost
    return fit.cost - fit.equations.decrement_within(fit.position, fit.coordinates)


def _moved(fit: Fit, part: Fit, whole: Fit) -> Fit:
    """The fit on a subset, moved by the difference of the final fits on all samples and on it."""
    moves = dict(zip(whole.coordinates.names, whole.position - part.position, strict=True))
    own = fit.coordinates
    position = fit.position + np.array([moves.get(name, 0.0) for name in own.names])
    return replace(fit, position=np.clip(position, own.lower, own.upper))


def _fitted_from(
    base: Fit, values: Array, term: AbstractEffect, own: Array, limits: TerminationLimits
) -> Fit:
    """Fit with a term added, from given values of the parameters and of the term's own."""
    start = Start(own, along=Along.to(base, values))
    if not term.parameters[0].vanishes:
        return refitted_with(base, term, [start], limits)
    # A refit would start from a smaller amplitude if that fits better, and return to `base`.
    added = refitted_with(base, term, [start], TerminationLimits(0))
    there = dict(zip(base.coordinates.names, values, strict=True))
    there |= {f"{term.name}.{p.name}": x for p, x in zip(term.parameters, own, strict=True)}
    return continued(added.moved_to(there), limits)


def _rows(fit: Fit) -> int:
    return sum(record.rows for record in fit.simulator.records)


def unresolved_transients(fit: Fit, fraction: float) -> tuple[OmittedTerm, ...]:
    """Parameter changes to a motor with a tenth of the inductance, unless the runs exclude it.

    If the motor settles within a sample interval, each sample shows only what is left of two
    transients that overlap.  The runs then determine a curve of resistances, inertias and
    inductances that fit nearly equally well, and the covariance at the optimum covers only a part
    of it.  All parameters are therefore refitted with a tenth of the inductance.  If the log
    likelihood falls by less than the limit, the change joins the intervals as a swapped lag does.
    """
    at, interval = fit.by_name, sample_interval(fit.simulator.records)
    slow = at["J"] / (at["b"] + at["Kt25"] ** 2 / at["Ra25"])
    row = fit.coordinates.names.index("L")
    if slow >= interval or fit.coordinates.parameters[row].origin:
        return ()
    position = fit.position.copy()
    values = fit.values.copy()
    values[row] *= DEFAULT.remaining_lag
    position[row] = fit.coordinates.of(values)[row]
    parameters = list(fit.coordinates.parameters)
    parameters[row] = replace(parameters[row], lower=values[row], upper=values[row])
    limits = TerminationLimits(DEFAULT.steps, fit.cost + DEFAULT.exclusion_loss / fraction)
    coordinates = Coordinates(parameters)
    simulator = fit.simulator.suited_to(values)
    found = solve(simulator, coordinates, position, fit.states, fit.weighting, limits)
    loss = fraction * (found.cost - fit.cost)
    if not loss < DEFAULT.exclusion_loss:
        return ()
    step = (found.position - fit.position) / np.sqrt(max(2.0 * loss, 1.0))
    steps = dict(zip(fit.coordinates.names, map(float, step), strict=True))
    time = float(found.values[row] / at["Ra25"])
    return (OmittedTerm("unresolved_transient", None, None, steps, time=time),)
