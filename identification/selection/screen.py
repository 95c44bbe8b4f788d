"""Rao score (Lagrange multiplier) screening of candidate terms.

Each prototype costs one simulation.  Its deviation from the current model is compared with the
residual (`projection.py`); the result is the gain in log likelihood if the amplitude of the effect
were free and all parameters were refitted, to first order.

Source: Rao, Proc. Cambridge Philosophical Society 44 (1948), 50-57 (score test).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from identification.arrays import Array
from identification.effects.effect import AbstractForced, Candidate
from identification.fit.order_tracking import block_edges, block_products
from identification.fit.solve import Fit
from identification.model.excitation import squares_of
from identification.model.lowering import LANES
from identification.model.scan import Effort
from identification.model.simulate import initial_states
from identification.selection.forcing import responses, trajectory
from identification.selection.policy import DEFAULT, SelectionPolicy
from identification.selection.projection import Projection, Residual, gains_of, group_products
from identification.selection.score import Score, recurring, sized

__all__ = ["screened"]

_MANY: Final = 1_000_000
"""Samples times prototypes above which better optimised code pays off even if it runs once."""


def screened(
    fit: Fit, candidates: Sequence[Candidate], policy: SelectionPolicy = DEFAULT
) -> list[Score]:
    """Scores of the prototypes of all candidates, added to a fit at its optimum, best first."""
    fit = fit.full()
    residual = Residual.of(_coarse(fit, policy.screening_substeps), policy.screening_samples)
    forced = [candidate for candidate in candidates if isinstance(candidate.term, AbstractForced)]
    scores = _scores_of_forced(residual, [c for c in forced if not c.by_record])
    own = [candidate for candidate in forced if candidate.by_record]
    for candidate, deviations in zip(
        own, _by_candidate(_forced(residual.fit, own), own), strict=True
    ):
        scores += _scores_by_record(residual, candidate, deviations)
    simulated = [c for c in candidates if not isinstance(c.term, AbstractForced)]
    known = residual.fit.equations.logged
    if residual.fit.simulator.substeps is not None:
        known = tuple(residual.fit.simulated())
    for group in _groups(simulated):
        for candidate, deviations in zip(
            group, _deviations(residual.fit, known, group), strict=True
        ):
            scores += _scores(residual, candidate, deviations)
    return sorted(scores, key=lambda score: -score.gain)


def _coarse(fit: Fit, substeps: int) -> Fit:
    """The fit with few substeps per sample interval, accurate enough for differences of models.

    A stiff model can diverge with few substeps, and then has no finite score.  Their number is
    doubled until the integration error of each channel is smaller than the residual.
    """
    whole = fit.simulator.substeps
    while whole is not None and substeps < max(int(each.counts.max()) for each in whole):
        few = tuple(each.at_most(substeps) for each in whole)
        coarse = replace(fit, simulator=replace(fit.simulator, substeps=few))
        if _is_within_residual(coarse):
            return coarse
        substeps *= 2
    return fit


def _is_within_residual(coarse: Fit) -> bool:
    """True if the integration error of a simulation is smaller than the residual of its fit."""
    records, fitted = coarse.simulator.records, coarse.equations.logged
    errors = [a - b for a, b in zip(coarse.simulated(), fitted, strict=True)]
    residuals = [record.measured - b for record, b in zip(records, fitted, strict=True)]
    return bool(np.all(squares_of(records, errors) < squares_of(records, residuals)))


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
    columns = _columns(candidates)

    def forces(k: int) -> Array:
        record, current, speed = trajectory(fit, k)
        force = np.zeros((record.rows, 2, columns[-1].stop))
        for candidate, own in zip(candidates, columns, strict=True):
            term = candidate.term
            assert isinstance(term, AbstractForced)
            row = 0 if term.equation == "electrical" else 1
            force[:, row, own] = term.forces(record, current, speed, candidate.starts)
        return force

    return responses(fit, forces, stride) if candidates else iter(())


def _columns(candidates: Sequence[Candidate]) -> list[slice]:
    """Lanes of each candidate, all side by side."""
    ends = np.cumsum([candidate.lanes for candidate in candidates]).tolist()
    return [slice(end - each.lanes, end) for each, end in zip(candidates, ends, strict=True)]


def _by_candidate(records: Iterable[Array], candidates: Sequence[Candidate]) -> list[list[Array]]:
    """For each candidate its lanes in each record."""
    whole = list(records)
    return [[each[:, :, own] for each in whole] for own in _columns(candidates)]


def _scores_of_forced(residual: Residual, candidates: Sequence[Candidate]) -> list[Score]:
    """Scores of many forcing terms; only one record's responses are in memory at a time."""
    if not candidates:
        return []
    forced = _forced(residual.fit, candidates, residual.stride)
    projection = residual.project(forced, sum(candidate.lanes for candidate in candidates))
    scores: list[Score] = []
    for candidate, own in zip(candidates, _columns(candidates), strict=True):
        scores += _scores_from(candidate, projection.of(own))
    return scores


def _scores(residual: Residual, candidate: Candidate, deviations: list[Array]) -> list[Score]:
    if candidate.by_run:
        return _scores_by_run(residual, candidate, deviations)
    if candidate.by_record and candidate.lanes == 1:
        return _score_of_each_record(residual, candidate, deviations)
    if candidate.by_record and candidate.final.tracked:
        return _scores_in_blocks(residual, candidate, deviations)
    if candidate.by_record:
        return _scores_by_record(residual, candidate, deviations)
    compared = [deviation[:: residual.stride] for deviation in deviations]
    return _scores_from(candidate, residual.project(compared, candidate.lanes))


def _scores_by_run(
    residual: Residual, candidate: Candidate, deviations: Sequence[Array]
) -> list[Score]:
    """Scores of starts in single runs and in several runs together."""
    lanes, records = candidate.lanes, residual.fit.simulator.records
    runs = list(dict.fromkeys(record.run for record in records))
    numbers = [runs.index(record.run) for record in records]
    separate = _separated(deviations, numbers, residual.stride)
    projection = residual.project(separate, lanes * len(runs))
    scores: list[Score] = []
    for number, run in enumerate(runs):
        for lane in range(lanes):
            own = slice(lanes * number + lane, lanes * number + lane + 1)
            single = replace(candidate, starts=candidate.starts[:, lane : lane + 1])
            scores += [
                replace(score, control=_control(projection, [number], lane, lanes))
                for score in _scores_from(single.in_runs(run), projection.of(own))
            ]
    for lane in range(lanes):
        recurrence = projection.of(slice(lane, None, lanes))
        for score in recurring(
            candidate, lane, recurrence.onto_residual, recurrence.products, recurrence.along, runs
        ):
            chosen = [runs.index(run) for run in score.candidate.term.runs]
            scores.append(replace(score, control=_control(projection, chosen, lane, lanes)))
        if candidate.each_run is not None:
            scores += _score_of_amplitudes(candidate.each_run, lane, recurrence, numbers)
    return scores


def _control(projection: Projection, numbers: Sequence[int], lane: int, lanes: int) -> float | None:
    """Median over the other runs of their largest gain, given one start in the numbered runs."""
    gains = projection.conditional_gains([lanes * number + lane for number in numbers])
    others = np.delete(gains.reshape(-1, lanes), numbers, axis=0)
    best = np.max(others, axis=1, initial=0.0, where=np.isfinite(others))
    return float(np.median(best)) if best.size else None


def _separated(deviations: Sequence[Array], numbers: Sequence[int], stride: int) -> Iterator[Array]:
    """Compared deviations of each record in the lanes of its number; all others are zero."""
    for deviation, number in zip(deviations, numbers, strict=True):
        part = deviation[::stride]
        lanes = part.shape[2]
        wide = np.zeros((*part.shape[:2], lanes * (max(numbers) + 1)))
        wide[:, :, lanes * number : lanes * (number + 1)] = part
        yield wide


def _score_of_each_record(
    residual: Residual, candidate: Candidate, deviations: Sequence[Array]
) -> list[Score]:
    """Score of one start with a free amplitude per record; parameters are projected out."""
    records = len(deviations)
    separate = _separated(deviations, range(records), residual.stride)
    return _score_of_amplitudes(candidate, 0, residual.project(separate, records), range(records))


def _score_of_amplitudes(
    candidate: Candidate, lane: int, projection: Projection, numbers: Sequence[int]
) -> list[Score]:
    """Score of the start in `lane` with free amplitudes; empty if it is not finite.

    The lanes of the projection are those of the amplitudes; `numbers` are the lanes of the records.
    """
    count = len(candidate.final.parameters)
    gain, weights = projection.gain()
    if not np.isfinite(gain):
        return []
    start = candidate.starts[:, lane]
    own = tuple(start[count:] * weights[number] for number in numbers)
    return [Score(candidate, start[:count].copy(), gain, None, own, projection.along.by(weights))]


def _scores_from(candidate: Candidate, projection: Projection) -> list[Score]:
    """Scores of starts with amplitudes common to all records."""
    size, scores = candidate.joint, []
    gains, amplitudes = projection.group_gains(size)
    for first, gain, weights in zip(
        range(0, candidate.lanes, size), gains.tolist(), amplitudes, strict=True
    ):
        if np.isfinite(gain):
            joint = projection.of(slice(first, first + size))
            start, taken = sized(candidate, first, weights)
            score = Score(candidate, start, gain, joint.covariance(), (), joint.along.by(taken))
            is_single = weights.size == 1 and taken[0] != 0.0
            scores.append(replace(score, best=float(weights[0] / taken[0])) if is_single else score)
    return scores


def _scores_in_blocks(
    residual: Residual, candidate: Candidate, deviations: Sequence[Array]
) -> list[Score]:
    """Scores of starts with a phase that drifts: amplitudes are free in blocks of each record.

    The initial amplitudes of a record are those of its most informative block.
    """
    group, count = candidate.joint, len(candidate.final.parameters)
    weighting, records = residual.fit.weighting, residual.fit.simulator.records
    deviation, scores = weighting.deviation, []
    for first in range(0, candidate.lanes, group):
        span = slice(first, first + group)
        order, total, own = float(candidate.starts[0, first]), 0.0, []
        for k, (part, series) in enumerate(zip(deviations, residual.series, strict=True)):
            edges = block_edges(records[k], order, float(deviation[1]))
            scaled = weighting.both_whitened(part[:, :, span]) / deviation[:, None]
            left = weighting.both_whitened(series) / deviation
            blocks = block_products(scaled, left, weighting.sample_weights(k), edges)
            gains, weights = gains_of(*blocks)
            penalty = 0.5 * group * (gains.size - 1) * np.log(records[k].rows / gains.size)
            total += float(np.nansum(gains)) - penalty
            best = int(np.argmax(np.trace(blocks[0], axis1=1, axis2=2)))
            own.append(candidate.starts[count:, span] @ weights[best])
        if np.isfinite(total) and all(np.isfinite(each).all() for each in own):
            start = candidate.starts[:count, first].copy()
            scores.append(Score(candidate, start, total, None, tuple(own)))
    return scores


def _scores_by_record(
    residual: Residual, candidate: Candidate, deviations: Sequence[Array]
) -> list[Score]:
    """Scores of starts with free amplitudes per record; parameters and states are held."""
    group, count = candidate.joint, len(candidate.final.parameters)
    found = []
    for k, deviation in enumerate(deviations):
        square, right, _ = residual.products(k, deviation[:: residual.stride])
        found.append(gains_of(group_products(square, group), right.reshape(-1, group)))
    scores = []
    for number, total in enumerate(np.sum([gains for gains, _ in found], axis=0)):
        if np.isfinite(total):
            span = slice(number * group, (number + 1) * group)
            own = tuple(candidate.starts[count:, span] @ weights[number] for _, weights in found)
            start = candidate.starts[:count, span.start].copy()
            scores.append(Score(candidate, start, float(total), None, own))
    return scores


def _deviations(fit: Fit, known: Sequence[Array], group: Sequence[Candidate]) -> list[list[Array]]:
    """For each candidate of a group and each record (n_sample, 2, n_start) deviations from `known`.

    One model contains all terms of the group; in the lanes of one candidate the amplitudes of the
    others are zero.
    """
    model = fit.simulator.model.adding(*[candidate.term for candidate in group])
    records = fit.simulator.records
    columns = _columns(group)
    lanes = columns[-1].stop
    rows = [np.repeat(fit.values[:, None], lanes, axis=1)]
    for candidate, column in zip(group, columns, strict=True):
        own = np.repeat(candidate.resting[:, None], lanes, axis=1)
        own[:, column] = candidate.starts.reshape(-1, candidate.lanes)
        rows.append(own)
    values = np.concatenate(rows)
    last = [column.stop - 1 for column in columns]
    simulator = fit.simulator.changed_to(model, values[:, last])
    states = [
        np.concatenate([state, initial_states(model, record)[state.size :]])
        for state, record in zip(fit.states, records, strict=True)
    ]
    samples = sum(record.rows for record in records)
    effort: Effort = "once" if samples * lanes < _MANY else "some"
    with np.errstate(over="ignore", invalid="ignore"):
        deviations = [
            logged - before[:, :, None]
            for logged, before in zip(simulator.logged(values, states, effort), known, strict=True)
        ]
    return _by_candidate(deviations, group)
