"""Draws of the parameters from the files of a result.

with open("posterior.nc", "rb") as file:
draws = chain_draws(file, 2000)
draws = normal_draws(result, 2000)                 without a posterior
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, BinaryIO, Final

import numpy as np
from numpy.typing import NDArray

from identification.errors import InputError
from identification.quantities import DECLARED_PARAMETERS

__all__ = ["chain_draws", "normal_draws"]

Array = NDArray[np.float64]

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
    normal = _root(result) @ rng.standard_normal((len(DECLARED_PARAMETERS), count))
    draws = {}
    for k, parameter in enumerate(DECLARED_PARAMETERS):
        entry = result["parameters"].get(parameter) or {}
        centre, spread = entry.get("median"), entry.get("sd")
        if not isinstance(centre, int | float) or not isinstance(spread, int | float):
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


def _root(result: Mapping[str, Any]) -> Array:
    """Symmetric root of the correlation matrix of the nominal parameters; identity if unknown.

    Rounding to the digits of the file can leave a slightly negative eigenvalue, which counts as
    zero.
    """
    matrix = np.eye(len(DECLARED_PARAMETERS))
    entry = result.get("correlation") or {}
    places = {name: k for k, name in enumerate(entry.get("names", ()))}
    if places.keys() >= set(DECLARED_PARAMETERS):
        chosen = [places[name] for name in DECLARED_PARAMETERS]
        known = np.array(entry["matrix"], dtype=np.float64)[np.ix_(chosen, chosen)]
        off_diagonal = ~np.eye(len(chosen), dtype=bool) & np.isfinite(known)
        matrix[off_diagonal] = known[off_diagonal]
    values, vectors = np.linalg.eigh(matrix)
    return np.asarray(vectors @ np.diag(np.sqrt(np.maximum(values, 0.0))) @ vectors.T)
