"""Linear motor at a temperature: transfer function and state space, with uncertainty samples.

The states of the state space are current and speed, its inputs voltage and load torque, and its
outputs current and speed.  Nonlinear effects have no transfer function; the final parameters do.

`python-control` is an optional dependency.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from identification.arrays import Array
from identification.errors import InputError, OptionError
from identification.model.declared import coefficient_at
from identification.prediction import model_of
from identification.quantities import DECLARED_PARAMETERS
from identification.speed_loop.loop import motor_draws, plant
from identification.speed_loop.spread import checked_temperatures

if TYPE_CHECKING:
    import control

__all__ = ["best_values", "matrices", "polynomials", "state_space", "transfer_function"]

_EXTRA: Final = "pip install 'motorid[control]'"


def best_values(result: Mapping[str, Any]) -> dict[str, float]:
    """Values of the nominal parameters in the final model of a result, as `predict` uses them.

    Raises:
        InputError: A parameter or effect is missing or unknown.
    """
    model, values = model_of(result)
    known = dict(zip([p.name for p in model.parameters], values.tolist(), strict=True))
    return {name: known[name] for name in DECLARED_PARAMETERS}


def polynomials(values: Mapping[str, Array | float], temperature: float) -> tuple[Array, Array]:
    """Transfer functions from voltage to speed at a temperature [degC].

    Return gain (n_draw,) and monic denominators (n_draw, 3), falling powers of s.
    """
    (checked,) = checked_temperatures([temperature])
    return plant(motor_draws(values, [checked]), checked)


def matrices(values: Mapping[str, Array | float], temperature: float) -> tuple[Array, Array]:
    """State matrices of current and speed at a temperature [degC].

    Return A (n_draw, 2, 2) and B (n_draw, 2, 2); the inputs are voltage and load torque.
    """
    (checked,) = checked_temperatures([temperature])
    v = motor_draws(values, [checked])
    if np.any(v["L"] <= 0):
        raise InputError(
            "L of the result is 0 H; expected a value above zero for a state space of current and "
            "speed",
            column="L",
        )
    resistance = coefficient_at(v["Ra25"], v["alpha_Ra"], checked)
    constant = coefficient_at(v["Kt25"], v["alpha_Kt"], checked)
    electrical = [-resistance / v["L"], -constant / v["L"]]
    mechanical = [constant / v["J"], -v["b"] / v["J"]]
    zero = np.zeros_like(v["J"])
    a = np.array([electrical, mechanical])
    b = np.array([[1 / v["L"], zero], [zero, -1 / v["J"]]])
    return np.moveaxis(a, -1, 0), np.moveaxis(b, -1, 0)


def transfer_function(result: Mapping[str, Any], temperature: float) -> control.TransferFunction:
    """Transfer function from voltage [V] to speed [rad/s].

    Args:
        result: Content of a result.json.
        temperature: Temperature of winding and magnet [degC].

    Raises:
        OptionError: python-control is not installed, or the temperature is not accepted.
        InputError: A parameter or effect of the result is missing or unknown.
    """
    package = _control()
    gain, denominator = polynomials(best_values(result), temperature)
    names = {"inputs": ["voltage"], "outputs": ["speed"], "name": f"motor at {temperature:g} degC"}
    return package.TransferFunction([gain[0]], denominator[0].tolist(), **names)


def state_space(
    result: Mapping[str, Any], temperature: float, draws: Mapping[str, Array] | None = None
) -> list[control.StateSpace]:
    """State space of the best values, followed by one of each draw.

    Args:
        result: Content of a result.json.
        temperature: Temperature of winding and magnet [degC].
        draws: (n_draw,) for each nominal parameter; None for the best values alone.

    Raises:
        OptionError: python-control is not installed, or the temperature is not accepted.
        InputError: A parameter or effect of the result is missing or unknown.
    """
    package = _control()
    a, b = matrices(best_values(result), temperature)
    if draws is not None:
        more = matrices(draws, temperature)
        a, b = np.concatenate([a, more[0]]), np.concatenate([b, more[1]])
    names = {
        "states": ["current", "speed"],
        "inputs": ["voltage", "load_torque"],
        "outputs": ["current", "speed"],
    }
    return [
        package.StateSpace(one, other, np.eye(2), np.zeros((2, 2)), **names)
        for one, other in zip(a, b, strict=True)
    ]


def _control() -> Any:
    """The package python-control; raise `OptionError` if it is not installed."""
    try:
        import control  # noqa: PLC0415
    except ImportError as error:
        raise OptionError(f"python-control is not installed; install it with: {_EXTRA}") from error
    return control
