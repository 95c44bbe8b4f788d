"""Draws of the parameters from the files of a result.

with open("posterior.nc", "rb") as file:
draws = chain_draws(file, 2000)
draws = normal_draws(result, 2000)                 without a posterior
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, BinaryIO, Final

import numpy as np

from identification.arrays import Array
from identification.errors import InputError
from identification.quantities import DECLARED_PARAMETERS

__all__ = ["chain_draws", "normal_draws"]

_SEED: Final = 0
_LOGARITHMIC: Final = ("Ra25", "Kt25", "J")
_WIDEST: Final = 100.0
"""Largest absolute log ratio of a drawn parameter to its median."""


def chain_draws(posterior: BinaryIO, most: int, name: str | None = None) -> dict[str, Array]:
    """Draws of the posterior; a longer chain is thinned evenly.

    Args:
        posterior: Content of posterior.nc.
        most: Largest number of draws.
        name: Name of the file for the error.

    Returns:
        (n_draw,) for each parameter, the nominal ones first.

    Raises:
        InputError: The file is not a posterior.
    """
    import h5netcdf

    try:
        with h5netcdf.File(posterior, "r") as file:
            group = file.groups["posterior"]
            names = dict.fromkeys([*DECLARED_PARAMETERS, *group.variables])
            draws = {
                variable: np.asarray(group[variable][...]).T.ravel()
                for variable in names
                if variable not in group.dimensions
            }
    except (OSError, KeyError, ValueError) as error:
        raise InputError(
            f"is not a posterior of 'motorid fit' ({error}); repeat the fit or remove the file",
            file=name,
        ) from error
    kept = np.unique(np.linspace(0, draws["J"].size - 1, most).astype(int))
    return {name: values[kept].astype(np.float64) for name, values in draws.items()}


def normal_draws(
    result: Mapping[str, Any], count: int, name: str | None = None
) -> dict[str, Array]:
    """Normal draws from the medians, standard deviations and correlations of a result.

    Results of earlier versions hold no correlations; their draws are independent.  Either way,
    intervals from these draws are approximate.

    Args:
        result: Content of result.json.
        count: Number of draws.
        name: Name of the file for the error.

    Returns:
        (n_draw,) for each parameter.

    Raises:
        InputError: The result lacks a parameter.
    """
    rng = np.random.default_rng(_SEED)
    normal = _root(result, name) @ rng.standard_normal((len(DECLARED_PARAMETERS), count))
    draws = {}
    for k, parameter in enumerate(DECLARED_PARAMETERS):
        parameters = result.get("parameters")
        entry = parameters.get(parameter) if isinstance(parameters, Mapping) else None
        found = entry if isinstance(entry, Mapping) else {}
        centre, spread = _finite(found.get("median")), _finite(found.get("sd"))
        if centre is None or spread is None:
            raise InputError(
                f"has no median and sd of {parameter}; give the parameters with --set NAME=VALUE "
                "instead",
                file=name,
            )
        steps = normal[k] * spread
        if parameter in _LOGARITHMIC:
            # The spread of an undetermined parameter would overflow the exponential.
            draws[parameter] = centre * np.exp(np.clip(steps / centre, -_WIDEST, _WIDEST))
        elif parameter in ("b", "L"):
            draws[parameter] = np.abs(centre + steps)
        else:
            draws[parameter] = centre + steps
    return draws


def _finite(value: object) -> float | None:
    """The value as a float; None if it is no number or not within the range of floats."""
    try:
        number = float(value) if isinstance(value, int | float) else math.nan
    except OverflowError:
        return None
    return number if math.isfinite(number) else None


def _root(result: Mapping[str, Any], file: str | None) -> Array:
    """Symmetric root of the correlation matrix of the nominal parameters; identity if unknown.

    Rounding to the digits of the file can leave a slightly negative eigenvalue, which counts as
    zero.
    """
    matrix = np.eye(len(DECLARED_PARAMETERS))
    entry = result.get("correlation") or {}
    try:
        places = {name: k for k, name in enumerate(entry.get("names", ()))}
        chosen = [places[name] for name in DECLARED_PARAMETERS if name in places]
        known = np.array(entry.get("matrix", ()), dtype=np.float64)
        known = known[np.ix_(chosen, chosen)] if chosen else known
    except (AttributeError, TypeError, ValueError, IndexError, OverflowError):
        raise InputError(
            "has a correlation that is no matrix with a name for each row; use the unchanged "
            "result.json of 'motorid fit', or remove the correlation",
            file=file,
        ) from None
    if len(chosen) == len(DECLARED_PARAMETERS):
        off_diagonal = ~np.eye(len(chosen), dtype=bool) & np.isfinite(known)
        matrix[off_diagonal] = known[off_diagonal]
    values, vectors = np.linalg.eigh(matrix)
    return np.asarray(vectors @ np.diag(np.sqrt(np.maximum(values, 0.0))) @ vectors.T)
