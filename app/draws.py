"""Posterior draws of an existing result, read from posterior.nc or approximated."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from app.regular import open_regular
from identification.errors import InputError
from identification.quantities import DECLARED_PARAMETERS

__all__ = ["draws_of"]

Array = NDArray[np.float64]

_SEED: Final = 0
_LOGARITHMIC: Final = ("Ra25", "Kt25", "J")
_WIDEST: Final = 100.0
"""Largest absolute log ratio of a drawn parameter to its median."""


def draws_of(result: Mapping[str, Any], path: Path, most: int) -> tuple[dict[str, Array], str]:
    """Draws of the seven nominal parameters, as estimated with the final model.

    The posterior.nc in the directory of the result is used if it exists.  Otherwise independent
    draws are generated from the medians and standard deviations in the result; the correlations are
    lost, and the remark says so.

    Args:
        result: Content of the result.
        path: File that the result was read from.
        most: Number of draws; a longer chain is thinned evenly to this length.

    Returns:
        (n_draw,) for each parameter, and a remark for the user, which may be empty.

    Raises:
        InputError: The posterior cannot be read, or the result lacks a parameter.
    """
    posterior = path.with_name("posterior.nc")
    if posterior.exists():
        return _chain(posterior, most), ""
    return _normal(result, path, most), (
        f"no posterior.nc in the directory of {path.name}: independent draws from its medians and "
        "standard deviations are used, so the intervals of the metrics are approximate"
    )


def _chain(path: Path, most: int) -> dict[str, Array]:
    import h5netcdf

    try:
        with open_regular(path) as content, h5netcdf.File(content, "r") as file:
            group = file.groups["posterior"]
            draws = {name: np.asarray(group[name][...]).T.ravel() for name in DECLARED_PARAMETERS}
    except (OSError, KeyError, ValueError) as error:
        raise InputError(
            f"is not a posterior of 'motorid fit' ({error}); repeat the fit or remove the file",
            file=str(path),
        ) from error
    count = draws["J"].size
    kept = np.unique(np.linspace(0, count - 1, most).astype(int))
    return {name: values[kept].astype(np.float64) for name, values in draws.items()}


def _normal(result: Mapping[str, Any], path: Path, count: int) -> dict[str, Array]:
    rng = np.random.default_rng(_SEED)
    draws = {}
    for name in DECLARED_PARAMETERS:
        entry = result["parameters"].get(name) or {}
        centre, spread = entry.get("median"), entry.get("sd")
        if not isinstance(centre, int | float) or not isinstance(spread, int | float):
            raise InputError(
                f"has no median and sd of {name}; give the parameters with --set NAME=VALUE "
                "instead",
                file=str(path),
            )
        steps = rng.standard_normal(count) * spread
        if name in _LOGARITHMIC:
            # The spread of an undetermined parameter would overflow the exponential.
            draws[name] = centre * np.exp(np.clip(steps / centre, -_WIDEST, _WIDEST))
        elif name in ("b", "L"):
            draws[name] = np.abs(centre + steps)
        else:
            draws[name] = centre + steps
    return draws
