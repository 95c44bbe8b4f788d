"""Posterior as a NetCDF file readable by ArviZ 0.x and 1.x, xarray and netCDF4.

    posterior      one variable per parameter, dimensions (chain, draw); each walker is a chain
    sample_stats   lp (chain, draw): log posterior density, absent for normal draws;
                   acceptance_rate (chain,)

The file is written with h5netcdf, which needs neither ArviZ nor xarray.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import h5netcdf
import numpy as np
from numpy.typing import ArrayLike

from identification.arrays import Array
from identification.result.atomic import replacing
from identification.result.entries import INTERVAL_KIND, INTERVAL_LEVEL, SCHEMA_VERSION

__all__ = ["write_posterior"]

# Level 1 with byte shuffling: on noise, higher levels cost seconds and save only a few per cent.
_COMPRESSION: Final[dict[str, Any]] = {
    "compression": "gzip",
    "compression_opts": 1,
    "shuffle": True,
}


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
