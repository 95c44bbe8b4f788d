"""Records with more samples at the same voltages, as a reference for what a sample hides."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from identification.model.excitation import Record

__all__ = ["densely"]


def densely(record: Record, times: int) -> Record:
    """The record with so many samples per interval, at the same held voltages."""
    inputs = np.repeat(record.inputs, times, axis=0)
    inputs[:, 0] /= times
    return replace(
        record,
        time=np.concatenate([[0.0], np.cumsum(inputs[:-1, 0])]),
        inputs=inputs,
        measured=np.repeat(record.measured, times, axis=0),
        weight=np.repeat(record.weight, times, axis=0),
    )
