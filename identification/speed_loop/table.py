"""Feedback metrics as a table, for the Python library."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Protocol

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from identification.errors import InputError
from identification.speed_loop.controller import AbstractController
from identification.speed_loop.metrics import METRIC_UNITS
from identification.speed_loop.spread import feedback_metrics

__all__ = ["SPREAD", "HasDraws", "feedback", "feedback_table"]

SPREAD = ("median", "q05", "q95", "mean", "sd", "unit")
"""Columns of a quantity with a spread, as in result.json."""


class HasDraws(Protocol):
    """Identified motor with draws of its posterior."""

    def draws(self) -> Mapping[str, NDArray[np.float64]]:
        """(n_draw,) for each parameter, in its unit."""


def feedback(
    motor: HasDraws | Mapping[str, ArrayLike],
    temperatures: float | Sequence[float] = (25.0, 125.0),
    controllers: str | AbstractController | Sequence[str | AbstractController] = "P:1",
) -> pd.DataFrame:
    """Step response metrics and stability margins of the closed speed loop.

    Args:
        motor: An identification, a stored result, or the seven parameters of the nominal model by
            name, each a number or (n_draw,) draws.
        temperatures: Temperatures of winding and magnet [degC].
        controllers: ``P:1``, ``PI:kp,ki``, ``PID:kp,ki,kd``, or controllers of one's own.

    Returns:
        A row for each controller, temperature and metric: median, 90 % interval, mean, standard
        deviation and unit.

    Raises:
        InputError: `motor` is neither an identified motor nor its parameters.
        OptionError: A parameter, temperature or controller is not accepted.

    Examples:
        >>> motor = {"Ra25": 0.59, "alpha_Ra": 0.004, "Kt25": 0.071, "alpha_Kt": -0.002,
        ...          "J": 0.01, "b": 0.1, "L": 0.5}
        >>> table = feedback(motor, temperatures=[25, 125], controllers="P:1")
        >>> table.query("metric == 'steady_state'")["median"].round(3).tolist()
        [0.526, 0.386]
    """
    if isinstance(controllers, str | AbstractController):
        controllers = [controllers]
    if isinstance(temperatures, int | float):
        temperatures = [temperatures]
    return feedback_table(feedback_metrics(_draws(motor), temperatures, controllers))


def feedback_table(entries: Sequence[Mapping[str, Any]]) -> pd.DataFrame:
    """Table of the list under ``feedback`` of a result, a row for each metric."""
    rows = [
        [entry["controller"], entry["temperature_degC"], metric]
        + [entry[metric].get(name) for name in SPREAD]
        for entry in entries
        for metric in METRIC_UNITS
        if entry.get(metric) is not None
    ]
    return pd.DataFrame(rows, columns=["controller", "temperature_degC", "metric", *SPREAD])


def _draws(motor: HasDraws | Mapping[str, ArrayLike]) -> Mapping[str, ArrayLike]:
    if isinstance(motor, Mapping):
        if "schema_version" in motor:
            raise InputError(
                "motor is the content of a result.json, which has no draws; expected what identify "
                "or read_result returns, or the parameters by name"
            )
        return motor
    if not hasattr(motor, "draws"):
        raise InputError(
            f"motor is a {type(motor).__name__}; expected what identify or read_result returns, or "
            "the parameters by name"
        )
    return motor.draws()
