"""Detectability of an effect: rise of the validation error if the model omits the effect.

The nominal model is fitted to a campaign without noise.  With the root mean square r of the
residual on the validation runs, relative to the noise that the sensors would have, the error rises
by ``sqrt(1 + r^2) - 1``.  `size_for_rise` finds the effect size for a given rise.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from bench.campaign import EffectRequest, make_campaign
from bench.declared import fit_declared
from bench.motors import Motor
from bench.options import BenchOptions
from bench.sensors import NOISELESS

__all__ = ["held_out_rise", "size_for_rise"]


def held_out_rise(
    motor: Motor | str | int,
    effects: Sequence[str | tuple[str, float] | EffectRequest],
    seed: int = 0,
    options: BenchOptions | None = None,
    **changes: Any,
) -> float:
    """Relative rise of the validation error if the model omits the effects [-].

    A rise of 0.2 means that the best nominal model simulates the validation runs with an error 20 %
    above the noise, over both channels.  The arguments are those of `make_campaign`.
    """
    chosen = dataclasses.replace(options or BenchOptions(), **changes)
    quiet = make_campaign(motor, effects, seed, chosen, noise=NOISELESS)
    rated = quiet.motor
    sd = (chosen.noise.current * rated.rated_current, chosen.noise.speed * rated.rated_speed)
    return math.hypot(1.0, fit_declared(quiet, sd).held_out) - 1.0


def size_for_rise(
    motor: Motor | str | int,
    name: str,
    rise: float,
    law: str | None = None,
    seed: int = 0,
    options: BenchOptions | None = None,
    **changes: Any,
) -> float | None:
    """Effect size that raises the validation error by `rise`.

    The residual of the fit grows approximately as a power of the size.  The secant method is
    therefore applied to the logarithms of both.

    Args:
        motor: As for `make_campaign`.
        name: Name of the effect.
        rise: Target rise, for example 0.15 [-].
        law: Law of the effect; None for the textbook law.
        seed: Seed of the campaign.
        options: Options of the campaign.
        **changes: Fields of the options to change.

    Returns:
        The size.  None if no size between 1e-5 and 0.8 reaches the rise within 20 %, for example
        for the inductance of a motor that is sampled too slowly.
    """
    wanted = math.log(math.hypot(1.0 + rise, 0.0) ** 2 - 1.0)
    points: list[tuple[float, float]] = []
    size = 0.02
    for _ in range(8):
        request = EffectRequest(name, size, law)
        got = held_out_rise(motor, [request], seed, options, **changes)
        if abs(got - rise) <= 0.05 * rise:
            return size
        points.append((math.log(size), math.log(max((1.0 + got) ** 2 - 1.0, 1e-12))))
        points = sorted(points, key=lambda point: abs(point[1] - wanted))[:2]
        slope = 2.0
        if len(points) == 2 and points[0][0] != points[1][0]:
            slope = (points[0][1] - points[1][1]) / (points[0][0] - points[1][0])
        move = (wanted - points[0][1]) / float(np.clip(slope, 0.5, 4.0))
        size = float(np.clip(math.exp(points[0][0] + np.clip(move, -3.0, 3.0)), 1e-5, 0.8))
    final = held_out_rise(motor, [EffectRequest(name, size, law)], seed, options, **changes)
    return size if abs(final - rise) <= 0.2 * rise else None
