"""Search for gains that meet a specification with the largest robustness.

Candidates follow from the loop they give for the median motor: a crossover frequency w_c at which
the loop gain is 1, an integral action ki / kp = x w_c and a derivative action kd / kp = y / w_c.
The grid of x contains the cancellation of the slow pole, which is the magnitude optimum, and
x = 1/2, the symmetrical optimum with a = 2; `suited_controller` adds the exact magnitude optimum.

The search maximises the distance from the limits that the fraction p of the draws reaches
(`slack_at`), which is negative as long as the specification is not met with probability p.
Margins of all candidates come first, because they need no simulation; then the candidates with
sufficient margins are simulated with limits and effects, and the best are refined by a pattern
search.  Nothing is random, so equal input gives equal gains.

Source: Kessler, Regelungstechnik 3 (1955), 40-49 (magnitude optimum) and 6 (1958), 395-400
(symmetrical optimum); Astrom and Hagglund, Advanced PID Control, ISA 2006, chapters 6 and 7.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from typing import Final

import numpy as np

from identification.arrays import Array, evenly
from identification.errors import OptionError
from identification.speed_loop.controller import KINDS, PID, AbstractController
from identification.speed_loop.loop import suited_controller
from identification.tuning.drive import GAINS
from identification.tuning.judge import Judge, slack_at
from identification.tuning.specification import METRICS

__all__ = ["controller_of", "gains_of", "searched"]

_CROSSOVERS: Final = 18
_INTEGRAL: Final = (0.01, 0.04, 0.1, 0.2, 0.35, 0.5, 0.75, 1.0)
_DERIVATIVE: Final = (0.1, 0.3, 0.6, 1.0)
_FORWARD: Final = (0.3, 0.6, 1.0)
_DRAWS: Final = (6, 20)
_SIMULATED: Final = 160
_REFINED: Final = 2
_STEPS: Final = (1.3, 1.12, 1.05)
_REPEATS: Final = 4
_FINAL: Final = 4


def gains_of(controller: AbstractController) -> Array:
    """Gains in the order of `GAINS`, (4,).

    Raises:
        OptionError: The controller is not one of `KINDS`.
    """
    # A class of its own may have another transfer function.
    if type(controller) is PID:
        return np.array([getattr(controller, name) for name in GAINS])
    raise OptionError(
        f"controller {controller.text!r} cannot be simulated; expected {', '.join(KINDS)}"
    )


def controller_of(kind: str, gains: Array) -> str:
    """Text of a controller as the command line takes it."""
    named = dict(zip(GAINS, gains, strict=True))
    return f"{kind}:{','.join(f'{named[name]:.4g}' for name in KINDS[kind])}"


def searched(judge: Judge, kind: str, probability: float) -> Array:
    """Gains of a kind with the largest distance from the limits, (4,), of three digits.

    The fraction `probability` of the draws shall meet the specification.
    """
    count = len(judge.temperatures)
    temperatures = [judge.temperatures[k] for k in sorted({0, count // 2, count - 1})]
    few, more = (judge.of(judge.motor.thinned(n), temperatures) for n in _DRAWS)
    gains = _rounded(_candidates(judge, kind))
    gains = _with_margins(few, gains, probability)
    best = _best(few, gains, probability, _REFINED)
    for factor in _STEPS:
        for _ in range(_REPEATS):
            before = best[:, 0]
            best = _best(more, _neighbours(best, factor), probability, _REFINED)
            if (best[:, 0] == before).all():
                break
    best = _best(judge.of(judge.motor, temperatures), best, probability, _FINAL)
    return np.asarray(best[:, 0])


def _candidates(judge: Judge, kind: str) -> Array:
    """Gains on the grid of crossover, integral and derivative action, (4, n_candidate)."""
    temperature = judge.temperatures[len(judge.temperatures) // 2]
    middle = replace(judge.motor, values=np.median(judge.motor.values, axis=1, keepdims=True))
    gain, poles = (part[0] for part in middle.plants(temperature))
    crossover = _crossovers(judge, poles)
    actions: Sequence[tuple[float, float, float]] = {
        "P": [(0.0, 0.0, 0.0)],
        "PI": [(x, 0.0, 0.0) for x in _INTEGRAL],
        "PI+FF": [(x, 0.0, f) for x, f in product(_INTEGRAL, _FORWARD)],
        "PID": [(x, y, 0.0) for x, y in product(_INTEGRAL, _DERIVATIVE)],
    }[kind]
    slow = np.abs(np.roots(poles)).min()
    if kind != "P":
        # Cancellation of the slow pole: a different x at each crossover.
        actions = [*actions, *((-1.0, y, f) for _, y, f in actions[: len(actions) // 8])]
    columns = []
    for w, (x, y, f) in product(crossover, actions):
        x = slow / w if x < 0 else x
        plant = gain / np.polyval(poles, 1j * w)
        kp = 1.0 / (abs(plant) * abs(1 + 1j * (y - x)))
        columns.append([kp, kp * x * w, kp * y / w, f * poles[2] / gain])
    optimum = suited_controller(middle.draws, judge.specification.lag / 1.5)
    if optimum is not None and kind == "PI":
        columns.append(list(gains_of(optimum)))
    return np.array(columns).T


def _crossovers(judge: Judge, poles: Array) -> Array:
    """Crossover frequencies around those that the specification suggests [rad/s]."""
    spec = judge.specification
    if spec.rise_time is not None:
        centre = 2.0 / spec.rise_time
    elif spec.settling_time is not None:
        centre = 5.0 / spec.settling_time
    else:
        centre = 2.0 * np.abs(np.roots(poles)).min()
    highest = min(10.0 * centre, 0.9 * np.pi / spec.sample_time)
    return np.geomspace(min(0.15 * centre, 0.1 * highest), highest, _CROSSOVERS)


def _with_margins(judge: Judge, gains: Array, probability: float) -> Array:
    """The candidates whose margins are largest, or large enough, in every few draws."""
    required = judge.specification.required
    margins = {name: limit for name, limit in required.items() if METRICS[name].is_margin}
    if not margins:
        margins = {"gain_margin": 3.0, "phase_margin": 20.0}
    found = judge.margins(gains)
    slack = [METRICS[name].slack(found[name], limit) for name, limit in margins.items()]
    reached = slack_at(np.min(np.stack(slack), axis=(0, 2)), probability)
    # All sufficient ones are equal here; the simulation decides among them.
    order = np.argsort(-np.minimum(reached, 0.0), kind="stable")
    kept = order[:_SIMULATED]
    enough = order[reached[order] >= 0]
    if enough.size > _SIMULATED:
        kept = enough[evenly(enough.size, _SIMULATED)]
    return gains[:, kept]


def _best(judge: Judge, gains: Array, probability: float, count: int) -> Array:
    """The `count` candidates with the largest distance from the limits, best first."""
    found = judge.judged(gains)
    score = slack_at(found.of_draws, probability)
    # Where nothing settles, the mean of the bounded distances still shows the way.
    detail = np.mean(np.clip(found.of_draws, -10.0, 1.0), axis=1)
    order = np.lexsort((-detail, -np.maximum(score, -1e6)))
    return gains[:, order[:count]]


def _neighbours(gains: Array, factor: float) -> Array:
    """The given gains, and each with every combination of its gains multiplied or divided."""
    columns = []
    for column in gains.T:
        free = np.flatnonzero(column)
        for powers in product((-1, 0, 1), repeat=free.size):
            near = column.copy()
            near[free] *= factor ** np.array(powers)
            columns.append(near)
    return np.unique(_rounded(np.array(columns).T), axis=1)


def _rounded(gains: Array) -> Array:
    """Gains of three digits, as the user will copy them."""
    return np.array([[float(f"{value:.3g}") for value in row] for row in gains])
