"""Real pipeline in which one seed waits, so that a test can watch and cancel the fit."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

from identification import pipeline
from identification.ingest import Run
from identification.options import FitOptions
from identification.posterior.checkpoint import Checkpoint

__all__ = ["WAITS", "identify"]

WAITS = 77
"""Seed of a fit that reports a fifth and does not end."""


def identify(
    training: Sequence[Run],
    validation: Sequence[Run],
    options: FitOptions,
    progress: Callable[[str, float], None],
    checkpoint: Checkpoint | None = None,
) -> pipeline.Identification:
    """Identify the motor, unless the seed says to wait."""
    if options.seed == WAITS:
        progress("effects", 0.2)
        time.sleep(600)
    return pipeline.identify(training, validation, options, progress, checkpoint)
