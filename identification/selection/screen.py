"""Rao score (Lagrange multiplier) screening of candidate terms.

Each prototype costs one simulation.  Its deviation d from the current model is projected on the
complement of everything that the fitted parameters and initial states can reproduce.  The remainder
d_perp is compared with the residual r:

    gain = (d_perp' W r)^2 / (2 d_perp' W d_perp)               [log likelihood]

To first order, this is the gain in log likelihood if the amplitude of the effect were free and all
parameters were refitted.  The plain correlation of d with r would mislead, because the parameters
fitted without the effect have absorbed part of it.

Source: Rao, Proc. Cambridge Philosophical Society 44 (1948), 50-57 (score test).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from identification.effects.effect import AbstractForced, Candidate
from identification.fit.derivatives import gradient_of
from identification.fit.solve import Fit
from identification.linear import least_squares, solution
from identification.model.lowering import LANES
from identification.model.scan import Effort
from identification.model.simulate import initial_states
from identification.selection.forcing import responses
from identification.selection.recurring import recurring
from identification.selection.score import Score, sized
from identification.selection.start import Along
from identification.work import TOUCH, charge

__all__ = ["screened"]

_MANY = 1_000_000
"""Samples times prototypes above which better optimised code pays off even if it runs once."""

_ENOUGH = 20_000
"""Samples at which deviations are compared with the residual.  On this many samples, an effect that
changes the error by 2 % gains hundreds in log likelihood."""

_PASSES = 6.0
"""Memory passes of a product over each deviation, for the operation count."""

_SUBSTEPS = 2
"""Substeps of a sample interval at most.  Effects can be told apart without their fastest
transients."""

Array = NDArray[np.float64]


def screened(fit: Fit, candidates: Sequence[Candidate]) -> list[Score]:
    """Scores of the prototypes of all candidates, best first.

    Args:
        fit: Fit of the current model at its optimum.
        candidates: Structures to score.
    """
    fit = fit.full()
    residuals = [
        record.measured - logged
        for record, logged in zip(fit.simulator.records, fit.equations.logged, strict=True)
    ]
    fit = _rough(fit)
    known = fit.equations.logged if fit.simulator.substeps is None else fit.simulated()
    scores: list[Score] = []
    forced = [candidate for candidate in candidates if isinstance(candidate.term, AbstractForced)]
    scores += _scores_of_forced(fit, [c for c in forced if not c.by_record], residuals)
    own = [candidate for candidate in forced if candidate.by_record]
    for candidate, deviations in zip(own, _separated(_forced(fit, own), own), strict=True):
        scores += _scores_by_record(fit, candidate, deviations, residuals)
    for group in _groups([c for c in candidates if not isinstance(c.term, AbstractForced)]):
        for candidate, deviations in zip(group, _deviations(fit, known, group), strict=True):
            scores += _scores(fit, candidate, deviations, residuals)
    return sorted(scores, key=lambda score: -score.gain)


def _groups(candidates: Sequence[Candidate]) -> list[list[Candidate]]:
    """Groups of candidates that share one simulation.

    Only candidates with few prototypes and an amplitude that can be zero are grouped.  Lanes come
    in blocks, and every structure has to be compiled, so several small structures in one model cost
    little more than one of them.
    """
    groups: list[list[Candidate]] = []
    small: list[Candidate] = []
    for candidate in sorted(candidates, key=lambda c: c.lanes):
        names = {other.term.name for other in small}
        if not candidate.can_rest or candidate.term.name in names:
            groups.append([candidate])
        elif sum(other.lanes for other in small) + candidate.lanes <= LANES:
            small.append(candidate)
        else:
            groups += [small] if small else []
            small = [candidate]
    return groups + ([small] if small else [])


def _forced(fit: Fit, candidates: Sequence[Candidate], stride: int = 1) -> Iterator[Array]:
    """Deviations caused by forcing terms, all lanes side by side, record by record."""

    def forces(k: int) -> Array:
        record = fit.simulator.records[k]
        part = replace(
            fit.simulator,
            records=(record,),
            substeps=fit.simulator.substeps and (fit.simulator.substeps[k],),
        )
        states = part.states(fit.values[:, None], fit.states[k : k + 1])[0]
        force = np.zeros((record.rows, 2, sum(candidate.lanes for candidate in candidates)))
        start = 0
        for candidate in candidates:
            row = 0 if candidate.term.equation == "electrical" else 1
            term = candidate.term
            assert isinstance(term, AbstractForced)
            force[:, row, start : start + candidate.lanes] = term.forces(
                record, states[:, 0, 0], states[:, 1, 0], candidate.starts
            )
            start += candidate.lanes
        return force

    return responses(fit, forces, stride) if candidates else iter(())


def _separated(responses: Iterator[Array], candidates: Sequence[Candidate]) -> list[list[Array]]:
    """For each candidate its deviations in each record."""
    records = list(responses)
    ends = np.cumsum([candidate.lanes for candidate in candidates])
    return [
        [response[:, :, end - candidate.lanes : end] for response in records]
        for candidate, end in zip(candidates, ends, strict=True)
    ]


def _scores_of_forced(
    fit: Fit, candidates: Sequence[Candidate], residuals: Sequence[Array]
) -> list[Score]:
    """Scores of many forcing terms; only one record's responses are in memory at a time."""
    if not candidates:
        return []
    lanes = sum(candidate.lanes for candidate in candidates)
    stride = _stride(fit)
    forced = _forced(fit, candidates, stride)
    projections, products, along = _normal(fit, forced, residuals, lanes, stride)
    scores: list[Score] = []
    start = 0
    for candidate in candidates:
        span = slice(start, start + candidate.lanes)
        scores += _scores_from(candidate, projections[span], products[span, span], along.of(span))
        start += candidate.lanes
    return scores


def _stride(fit: Fit) -> int:
    """Decimation factor of the comparison; 1 if the noise is whitened."""
    if any(len(taps) > 1 for taps in fit.weighting.whitening):
        return 1
    return max(sum(record.rows for record in fit.simulator.records) // _ENOUGH, 1)


def _scores(
    fit: Fit, candidate: Candidate, deviations: list[Array], residuals: Sequence[Array]
) -> list[Score]:
    if candidate.by_run:
        return _scores_by_run(fit, candidate, deviations, residuals)
    if candidate.by_record and candidate.lanes == 1:
        return _score_of_each_record(fit, candidate, deviations, residuals)
    if candidate.by_record:
        return _scores_by_record(fit, candidate, deviations, residuals)
    return _scores_together(fit, candidate, deviations, residuals)


def _scores_together(
    fit: Fit, candidate: Candidate, deviations: Sequence[Array], residuals: Sequence[Array]
) -> list[Score]:
    """Scores of starts with amplitudes common to all records."""
    stride = _stride(fit)
    kept = [deviation[::stride] for deviation in deviations]
    return _scores_from(candidate, *_normal(fit, kept, residuals, candidate.lanes, stride))


def _scores_by_run(
    fit: Fit, candidate: Candidate, deviations: Sequence[Array], residuals: Sequence[Array]
) -> list[Score]:
    """Scores of starts in single runs and, if the event can recur, in several runs together."""
    stride, lanes = _stride(fit), candidate.lanes
    runs = list(dict.fromkeys(record.run for record in fit.simulator.records))
    places = [runs.index(record.run) for record in fit.simulator.records]
    projections, products, along = _normal(
        fit, _apart(deviations, places, stride), residuals, lanes * len(runs), stride
    )
    scores: list[Score] = []
    for number, run in enumerate(runs):
        own = slice(lanes * number, lanes * (number + 1))
        scores += _scores_from(
            candidate.in_runs(run), projections[own], products[own, own], along.of(own)
        )
    for lane in range(lanes if candidate.recurs else 0):
        own = slice(lane, None, lanes)
        scores += recurring(
            candidate, lane, projections[own], products[own, own], along.of(own), runs
        )
    return scores


def _apart(deviations: Sequence[Array], places: Sequence[int], stride: int) -> Iterator[Array]:
    """Decimated deviations of each record in the columns of its position; all others are zero."""
    for deviation, place in zip(deviations, places, strict=True):
        part = deviation[::stride]
        lanes = part.shape[2]
        wide = np.zeros((*part.shape[:2], lanes * (max(places) + 1)))
        wide[:, :, lanes * place : lanes * (place + 1)] = part
        yield wide


def _score_of_each_record(
    fit: Fit, candidate: Candidate, deviations: Sequence[Array], residuals: Sequence[Array]
) -> list[Score]:
    """Score of one start with a free amplitude per record; parameters are projected out."""
    stride, count = _stride(fit), len(candidate.final.parameters)
    apart = _apart(deviations, range(len(deviations)), stride)
    projections, products, along = _normal(fit, apart, residuals, len(deviations), stride)
    gain, weights = _gain(products, projections)
    if not np.isfinite(gain):
        return []
    start = candidate.starts[:, 0]
    own = tuple(start[count:] * weight for weight in weights)
    return [Score(candidate, start[:count].copy(), gain, None, own, along.by(weights))]


def _scores_from(
    candidate: Candidate, projections: Array, products: Array, along: Along
) -> list[Score]:
    scores = []
    for first in range(0, candidate.lanes, candidate.joint):
        span = slice(first, first + candidate.joint)
        gain, weights = _gain(products[span, span], projections[span])
        if np.isfinite(gain):
            inverse = np.asarray(
                np.linalg.pinv(products[span, span], rcond=1e-8, hermitian=True), dtype=np.float64
            )
            start, weights = sized(candidate, first, weights)
            scores.append(Score(candidate, start, gain, inverse, (), along.of(span).by(weights)))
    return scores


def _scores_by_record(
    fit: Fit, candidate: Candidate, deviations: Sequence[Array], residuals: Sequence[Array]
) -> list[Score]:
    """Scores of starts with free amplitudes per record; parameters and states are held."""
    group, count = candidate.joint, len(candidate.final.parameters)
    scores = []
    for first in range(0, candidate.lanes, group):
        span = slice(first, first + group)
        total, own = 0.0, []
        for k, (deviation, residual) in enumerate(zip(deviations, residuals, strict=True)):
            part = deviation[:, :, span]
            right = gradient_of(residual, part, fit.weighting, k)
            square = np.column_stack(
                [gradient_of(part[:, :, j], part, fit.weighting, k) for j in range(group)]
            )
            gain, weights = _gain(square, right)
            total += gain
            own.append(candidate.starts[count:, span] @ weights)
        if np.isfinite(total):
            start = candidate.starts[:count, first].copy()
            scores.append(Score(candidate, start, total, None, tuple(own)))
    return scores


def _gain(square: Array, right: Array) -> tuple[float, Array]:
    """Gain of the log likelihood at the optimal amplitudes, and these amplitudes."""
    if not (np.isfinite(square).all() and np.isfinite(right).all()):
        return np.nan, right
    size = np.sqrt(np.maximum(np.diag(square), 0.0))
    if not (size > 0).all():
        return np.nan, right
    scaled = square / np.outer(size, size)
    weights = least_squares(scaled, right / size, 1e-8) / size
    return 0.5 * float(weights @ right), weights


def _rough(fit: Fit) -> Fit:
    """The fit with few substeps per sample interval, accurate enough for differences of models."""
    substeps = fit.simulator.substeps
    if substeps is None:
        return fit
    few = tuple(np.minimum(counts, _SUBSTEPS) for counts in substeps)
    return replace(fit, simulator=replace(fit.simulator, substeps=few))


def _deviations(fit: Fit, known: Sequence[Array], group: Sequence[Candidate]) -> list[list[Array]]:
    """For each candidate of a group and each record (n_sample, 2, n_start) deviations from `known`.

    One model contains all terms of the group; in the lanes of one candidate the amplitudes of the
    others are zero.
    """
    model = fit.simulator.model.adding(*[candidate.term for candidate in group])
    records = fit.simulator.records
    ends = np.cumsum([candidate.lanes for candidate in group])
    rows = [np.repeat(fit.values[:, None], ends[-1], axis=1)]
    for candidate, end in zip(group, ends, strict=True):
        own = np.repeat(candidate.resting[:, None], ends[-1], axis=1)
        own[:, end - candidate.lanes : end] = candidate.starts.reshape(-1, candidate.lanes)
        rows.append(own)
    values = np.concatenate(rows)
    simulator = fit.simulator.changed_to(model, values[:, ends - 1])
    states = [
        np.concatenate([state, initial_states(model, record)[state.size :]])
        for state, record in zip(fit.states, records, strict=True)
    ]
    samples = sum(record.rows for record in records)
    effort: Effort = "once" if samples * int(ends[-1]) < _MANY else "some"
    with np.errstate(over="ignore", invalid="ignore"):
        deviations = [
            logged - before[:, :, None]
            for logged, before in zip(simulator.logged(values, states, effort), known, strict=True)
        ]
    return [
        [deviation[:, :, end - candidate.lanes : end] for deviation in deviations]
        for candidate, end in zip(group, ends, strict=True)
    ]


def _normal(
    fit: Fit,
    deviations: Iterable[Array],
    residuals: Sequence[Array],
    count: int,
    stride: int = 1,
) -> tuple[Array, Array, Along]:
    """Projected products (n_start,) d_perp'Wr and (n_start, n_start) d_perp'Wd_perp, and the moves.

    Each compared sample stands for `stride` samples.  At a bound, or short of the optimum, d'Wr
    contains gain that the parameters can still achieve by themselves.  This gain is subtracted.
    The same holds if the decimated samples have another optimum than all samples.  The third value
    is the first-order change of parameters and initial states for each start.
    """
    equations, weighting = fit.equations, fit.weighting
    n = fit.position.size
    gradient = equations.gradient.copy()
    right = np.zeros(count)
    square = np.zeros((count, count))
    crossed = np.zeros((n, count))
    moved = []
    blocks = equations.derivatives.blocks(0)
    for deviation, residual, block in zip(deviations, residuals, blocks, strict=True):
        k = block.record
        charge(_PASSES * TOUCH * deviation.size)
        bad = np.asarray(~np.isfinite(deviation).all(axis=(0, 1)))
        safe = np.where(bad[None, None, :], 0.0, deviation)
        both = np.zeros((n + fit.simulator.n_state, count))
        asked = np.zeros(n + fit.simulator.n_state)
        for channel in range(2):
            weight = stride * weighting.sample_weights(k)[::stride, channel, None]
            white = weighting.whitened(safe[:, channel, :], channel)
            scaled = white * (weight / weighting.deviation[channel] ** 2)
            square += white.T @ scaled
            white_residual = weighting.whitened(residual[::stride, channel], channel)
            right += scaled.T @ white_residual
            tangent = weighting.whitened(block.tangent[::stride, channel, :], channel)
            both += tangent.T @ scaled
            asked += tangent.T @ (white_residual * weight[:, 0] / weighting.deviation[channel] ** 2)
        asked -= gradient_of(residual, block.tangent, weighting, k)
        solved = solution(equations.state_matrices[k], both[n:])
        square -= both[n:].T @ solved
        right -= solved.T @ (equations.state_gradients[k] + asked[n:])
        own = solution(equations.state_matrices[k], asked[n:])
        gradient += asked[:n] - equations.couplings[k].T @ own
        moved.append(solved)
        crossed += both[:n] - equations.couplings[k].T @ solved
        right[bad] = np.nan
    free = equations.matrix
    size = np.sqrt(np.diag(free))
    scaled_matrix = free / np.outer(size, size)
    solved = least_squares(scaled_matrix, crossed / size[:, None], 1e-12)
    moves = -solved / size[:, None]
    right += moves.T @ gradient
    states = [
        -own - solution(matrix, coupling @ moves)
        for own, matrix, coupling in zip(
            moved, equations.state_matrices, equations.couplings, strict=True
        )
    ]
    return right, square - (crossed / size[:, None]).T @ solved, Along(moves, tuple(states))
