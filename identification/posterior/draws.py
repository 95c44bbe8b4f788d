"""Draws of the nominal and the final model: from the chain or from the normal approximation."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from identification.arrays import Array
from identification.errors import ComputationError
from identification.fit.effective_samples import effective_fraction
from identification.fit.solve import Fit
from identification.fit.temperature import with_scale_drawn
from identification.options import EFFORTS, FitOptions
from identification.posterior.checkpoint import Checkpoint
from identification.posterior.density import Posterior
from identification.posterior.sample import Sample, sample
from identification.selection.non_identifiable import LinearPart, with_linear_parts_drawn
from identification.selection.omitted import OmittedTerm, with_omitted_drawn

__all__ = ["final_draws", "nominal_draws", "within_signs"]

_SIGNED: Final = ("Ra25", "Kt25", "J", "b", "L")


def final_draws(
    posterior: Posterior,
    lines: Sequence[LinearPart],
    omitted: Sequence[OmittedTerm],
    options: FitOptions,
    progress: Callable[[float], None],
    checkpoint: Checkpoint | None,
) -> tuple[Sample | None, dict[str, Array]]:
    """The chain, if requested, and draws (n_draw,) that include the non-identifiable directions.

    The linear parts belong either to a curve or to a nominal parameter; the omitted terms could
    change the parameters.

    Raises:
        ComputationError: A draw is infinite or NaN.
    """

    def opened(draws: dict[str, Array]) -> dict[str, Array]:
        draws = with_omitted_drawn(draws, posterior.fit, omitted, options.seed)
        draws = with_scale_drawn(draws, posterior.fit, options.seed)
        return with_linear_parts_drawn(draws, lines, options.seed)

    if not options.posterior:
        return None, within_signs(opened(posterior.normal_draws(options.seed)))
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
    return chain, within_signs(chain.draws())


def nominal_draws(declared: Fit, seed: int) -> dict[str, Array]:
    """Physical draws from the normal approximation of the nominal model's posterior, by name.

    Raises:
        ComputationError: A draw is infinite or NaN.
    """
    draws = Posterior(declared, effective_fraction(declared)).normal_draws(seed)
    return within_signs(with_scale_drawn(draws, declared, seed))


def within_signs(draws: dict[str, Array]) -> dict[str, Array]:
    """Draws with the signs of a physical motor; the loop would reject others as invalid input.

    A parameter that the runs hardly determine, as with a reversed sensor, has draws at its bound of
    0, where rounding decides the sign.

    Raises:
        ComputationError: A draw is infinite or NaN.
    """
    beyond = [name for name in _SIGNED if not np.isfinite(draws.get(name, 0.0)).all()]
    if beyond:
        raise ComputationError(
            f"the posterior of {', '.join(beyond)} has no end: the runs determine no motor; "
            "compare the largest values and the units of each channel in `motorid check RUN...` "
            "with the data sheet; log the voltage at the motor terminals if a drive sets it or "
            "limits the current, and fit fewer runs to find the one that contradicts the model"
        )
    return draws | {name: np.abs(draws[name]) for name in _SIGNED if name in draws}
