"""Posterior as a NetCDF file, and draws of the parameters from the files of a result.

    write_posterior(path, names, units, chain, log_prob, acceptance=0.3)
    with open("posterior.nc", "rb") as file:
        draws = chain_draws(file, 2000)
    draws = normal_draws(result, 2000)                 without a posterior

The file is readable by ArviZ 0.x and 1.x, xarray and netCDF4; h5netcdf, which writes it, needs
neither of them.

    posterior      one variable per parameter, dimensions (chain, draw); each walker is a chain
    sample_stats   lp (chain, draw): log posterior density, absent for normal draws;
                   acceptance_rate (chain,)
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, BinaryIO, Final

import h5netcdf
import numpy as np
from numpy.typing import ArrayLike, NDArray

from identification.arrays import Array, evenly
from identification.errors import DamagedFile, InputError, OutOfMemory
from identification.ingest.display import plain
from identification.ingest.formats.hdf5 import check_heaps
from identification.ingest.formats.library import decoding
from identification.quantities import DECLARED_PARAMETERS
from identification.result.atomic import replacing
from identification.result.entries import INTERVAL_KIND, INTERVAL_LEVEL, SCHEMA_VERSION
from identification.result.numbers import finite

__all__ = ["chain_draws", "check_same_fit", "normal_draws", "write_posterior"]

# On noise, higher levels cost seconds and save only a few per cent.
_COMPRESSION: Final[dict[str, Any]] = dict(compression="gzip", compression_opts=1, shuffle=True)
_SEED: Final = 0
_LOGARITHMIC: Final = ("Ra25", "Kt25", "J")
_FARTHEST_MEDIAN: Final = 5.0
"""Largest deviation between the medians of a posterior and of its result [sd]."""
_ROUNDING: Final = 1e-6
_MOST_DRAWS: Final = 100_000_000
"""Largest number of draws that a chain may have; a file may declare any."""
_WIDEST: Final = 100.0
"""Largest absolute log ratio of a drawn parameter to its median."""


def write_posterior(
    path: Path,
    names: Sequence[str],
    units: Sequence[str],
    chain: Array,
    log_prob: Array | None,
    *,
    acceptance: ArrayLike,
    attributes: Mapping[str, str] | None = None,
) -> None:
    """Write the sampler chain (n_draw, n_walker, n_param) to `path` atomically.

    Names and units are (n_param,), the log posterior density (n_draw, n_walker), None if unknown,
    the fraction of accepted proposals one number or (n_walker,) [-].  Attributes of the file may be
    added.
    """
    n_draw, n_walker, _ = chain.shape
    with replacing(path) as neighbour, h5netcdf.File(neighbour, "w") as file:
        file.attrs["schema_version"] = str(SCHEMA_VERSION)
        file.attrs["inference_library"] = "emcee"
        for key, value in (attributes or {}).items():
            file.attrs[key] = value

        posterior = _group(file, "posterior", n_walker, n_draw)
        posterior.attrs["interval_kind"] = INTERVAL_KIND
        posterior.attrs["interval_level"] = INTERVAL_LEVEL
        for index, (name, unit) in enumerate(zip(names, units, strict=True)):
            _variable(posterior, name, chain[:, :, index].T).attrs["units"] = unit
        stats = _group(file, "sample_stats", n_walker, n_draw)
        if log_prob is not None:
            _variable(stats, "lp", log_prob.T).attrs["long_name"] = "log posterior density"
        rate = stats.create_variable("acceptance_rate", ("chain",), np.float64)
        rate[...] = np.broadcast_to(np.asarray(acceptance, dtype=np.float64), (n_walker,))
        rate.attrs["long_name"] = "share of accepted proposals"


def _group(file: Any, name: str, n_walker: int, n_draw: int) -> Any:
    """Create a group with its own dimensions and coordinate variables, as readers expect."""
    group = file.create_group(name)
    group.dimensions = {"chain": n_walker, "draw": n_draw}
    for dimension, size in (("chain", n_walker), ("draw", n_draw)):
        group.create_variable(dimension, (dimension,), np.int64)[...] = np.arange(size)
    return group


def _variable(group: Any, name: str, values: Array) -> Any:
    variable = group.create_variable(name, ("chain", "draw"), np.float64, **_COMPRESSION)
    variable[...] = values
    return variable


def chain_draws(posterior: BinaryIO, most: int, name: str | None = None) -> dict[str, Array]:
    """Draws (n_draw,) of the posterior, the nominal parameters first; a longer chain is thinned.

    Raises:
        InputError: The file is not a posterior.
    """
    try:
        with decoding("a posterior of 'motorid fit'"):
            check_heaps(posterior)
            draws = _read(posterior)
    except (DamagedFile, OutOfMemory) as error:
        reason = plain(" ".join(str(error.__cause__).split()), 200)
        raise InputError(
            f"is not a posterior of 'motorid fit' ({reason}); repeat the fit or remove the file",
            file=name,
        ) from error
    kept = evenly(draws["J"].size, most)
    return {name: values[kept] for name, values in draws.items()}


def _read(posterior: BinaryIO) -> dict[str, Array]:
    """All draws of a file, the nominal parameters first."""
    with h5netcdf.File(posterior, "r") as file:
        group = file.groups["posterior"]
        names = dict.fromkeys([*DECLARED_PARAMETERS, *group.variables])
        shapes = {name: group[name].shape for name in names if name not in group.dimensions}
        if len(set(shapes.values())) != 1 or not 0 < math.prod(shapes["J"]) <= _MOST_DRAWS:
            listed = ", ".join(f"{shape} of {name}" for name, shape in list(shapes.items())[:8])
            raise ValueError(f"the shapes {listed}; expected one number of draws of each variable")
        return {name: _column(name, np.asarray(group[name][...])) for name in shapes}


def _column(name: str, values: NDArray[Any]) -> Array:
    """Draws of one variable, walker by walker.

    Raises:
        ValueError: They are no numbers, not finite, or not above zero as Ra25, Kt25 and J are.
    """
    draws = values.astype(np.float64).T.ravel()
    if not np.all(np.isfinite(draws)):
        raise ValueError(f"draws of {name} that are not finite")
    if name in _LOGARITHMIC and not np.all(draws > 0.0):
        raise ValueError(f"draws of {name} that are not above zero")
    return draws


def check_same_fit(result: Mapping[str, Any], draws: Mapping[str, Array], name: str) -> None:
    """Reject draws that do not belong to the parameters of a result.

    The medians of both differ by the noise of the sampler, about a tenth of a standard deviation.
    If several models share the posterior, the median of one with the probability p deviates by
    at most 1 / sqrt(p (1 - p)) standard deviations of all of them together, 3.3 for p = 0.1.

    Raises:
        InputError: The median of a parameter deviates by more than `_FARTHEST_MEDIAN`.
    """
    for parameter in DECLARED_PARAMETERS:
        centre, spread = _median_and_sd(result, parameter)
        if centre is None or spread is None or parameter not in draws:
            continue
        median = float(np.median(draws[parameter]))
        if abs(median - centre) > _FARTHEST_MEDIAN * abs(spread) + _ROUNDING * abs(centre):
            raise InputError(
                f"belongs to another fit than result.json: the median of {parameter} is "
                f"{median:.6g} here and {centre:.6g} there; copy both files of one fit, or remove "
                "this one",
                file=name,
                value=median,
            )


def normal_draws(
    result: Mapping[str, Any], count: int, name: str | None = None
) -> dict[str, Array]:
    """Normal draws (n_draw,) from medians, standard deviations and correlations of a result.

    Results of earlier versions hold no correlations; their draws are independent.  Either way,
    intervals from these draws are approximate.

    Raises:
        InputError: The result lacks a parameter.
    """
    rng = np.random.default_rng(_SEED)
    normal = _root(result, name) @ rng.standard_normal((len(DECLARED_PARAMETERS), count))
    draws = {}
    for k, parameter in enumerate(DECLARED_PARAMETERS):
        centre, spread = _median_and_sd(result, parameter)
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


def _median_and_sd(result: Mapping[str, Any], name: str) -> list[float | None]:
    """Median and standard deviation of a parameter; None for what is no finite number."""
    parameters = result.get("parameters")
    entry = parameters.get(name) if isinstance(parameters, Mapping) else None
    found = entry if isinstance(entry, Mapping) else {}
    return [finite(found.get("median")), finite(found.get("sd"))]


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
