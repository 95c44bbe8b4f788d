"""Files of the commands: checks of output paths, results and posterior draws of earlier fits."""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, Final, cast

import numpy as np
from numpy.typing import NDArray

from app.disk import open_regular
from identification.errors import InputError, OptionError, UnreadableFile
from identification.quantities import DECLARED_PARAMETERS

__all__ = ["draws_of", "read_result", "writable_directory", "writable_file"]

Array = NDArray[np.float64]

_SEED: Final = 0
_LOGARITHMIC: Final = ("Ra25", "Kt25", "J")
_WIDEST: Final = 100.0
"""Largest absolute log ratio of a drawn parameter to its median."""


@contextmanager
def writable_directory(directory: Path, option: str = "--out") -> Iterator[None]:
    """Create a directory with its parents and check that it is writable, before the computation.

    If the block fails, a directory created here is removed again if it is empty.

    Raises:
        OptionError: The directory cannot be created or written.
    """
    is_new = not directory.exists()
    try:
        directory.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=directory):
            pass
    except OSError as error:
        raise OptionError(
            f"{option} {directory}: cannot be written ({error.strerror}); choose another directory",
            value=str(directory),
        ) from error
    try:
        yield
    except BaseException:
        if is_new:
            with suppress(OSError):
                directory.rmdir()
        raise


@contextmanager
def writable_file(path: Path, option: str = "--out") -> Iterator[None]:
    """Check that a file can be written, as `writable_directory` does for a directory.

    Raises:
        OptionError: The path is a directory or cannot be written.
    """
    if path.is_dir():
        raise OptionError(f"{option} {path}: is a directory; expected a file name", value=str(path))
    with writable_directory(Path(os.path.abspath(path)).parent, option):
        yield


def read_result(path: Path) -> dict[str, Any]:
    """Content of a result.json.

    Raises:
        InputError: The file cannot be read or is not a result of ``motorid fit``.
    """
    try:
        with open_regular(path) as file:
            text = file.read().decode("utf-8-sig")
    except OSError as error:
        raise UnreadableFile(
            f"cannot be opened ({error.strerror}); expected a result.json of 'motorid fit'",
            file=str(path),
        ) from error
    except UnicodeDecodeError as error:
        raise InputError("is not text; expected a result.json", file=str(path)) from error
    try:
        content = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise InputError(
            "is not JSON; expected a result.json of 'motorid fit'",
            file=str(path),
            row=getattr(error, "lineno", None),
        ) from error
    version = content.get("schema_version") if isinstance(content, dict) else None
    if version != 1 or not isinstance(content.get("parameters"), dict):
        raise InputError(
            f"has schema_version {version!r}; expected a result.json of 'motorid fit' with "
            "schema_version 1",
            file=str(path),
        )
    return cast(dict[str, Any], content)


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
