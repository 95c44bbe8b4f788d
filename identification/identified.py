"""Identified motor for Python users: tables, posterior draws and display, fresh or read from disk.

found = read_result("out/motor")
found.table()
found.draws()["Ra25"]
"""

from __future__ import annotations

import errno
import json
import os
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from html import escape
from importlib import import_module
from pathlib import Path
from typing import Any, Final

import pandas as pd
from numpy.typing import ArrayLike

from identification.arrays import Array
from identification.errors import IdentificationError, InputError, UnreadableFile
from identification.ingest.formats.hdf5 import check_heaps
from identification.reporting.summary import summary_sentences
from identification.result.draws import chain_draws, check_same_fit, normal_draws
from identification.result.numbers import interval_text, unit_text
from identification.result.tables import TableName, as_written, feedback_table, result_table
from identification.speed_loop import AbstractController, feedback_metrics

__all__ = [
    "Identified",
    "MissingPackage",
    "StoredResult",
    "feedback",
    "inference_data",
    "read_result",
]

_MOST_DRAWS: Final = 2000


class MissingPackage(IdentificationError, ImportError):
    """A function needs a package that is not installed."""


class Identified(ABC):
    """Identified motor.

    Attributes:
        result: Content of result.json.
    """

    result: dict[str, Any]

    def table(self, name: TableName = "parameters") -> pd.DataFrame:
        """One table of the result; the columns are named as in result.json.

        Args:
            name: ``parameters`` of the final model with its effects, ``declared`` for those of the
                nominal model, ``effects``, ``errors``, ``feedback`` or ``warnings``.

        Raises:
            OptionError: There is no table of this name.
        """
        return result_table(self.result, name)

    @abstractmethod
    def draws(self) -> Mapping[str, Array]:
        """(n_draw,) draws of each parameter of the final model, in its unit."""

    @abstractmethod
    def posterior_file(self) -> AbstractContextManager[Path]:
        """Path of a posterior.nc with the chain, valid inside of the ``with`` statement.

        Raises:
            InputError: The posterior was not sampled.
        """

    def _repr_html_(self) -> str:
        """Summary, parameters and warnings, for notebooks."""
        with as_written("members"):
            sentences = " ".join(map(escape, summary_sentences(self.result)))
            warnings = "".join(f"<li>{escape(text)}</li>" for text in self.result["warnings"])
        return f"<p>{sentences}</p>{_parameters_html(self.table())}<ul>{warnings}</ul>"


@dataclass(frozen=True, repr=False)
class StoredResult(Identified):
    """Result of an earlier identification."""

    result: dict[str, Any]
    path: Path

    def __repr__(self) -> str:
        return f"StoredResult({str(self.path)!r})"

    @property
    def has_posterior(self) -> bool:
        """True if a posterior.nc is in the directory of the result."""
        return self.path.with_name("posterior.nc").exists()

    def posterior_file(self) -> AbstractContextManager[Path]:
        """The posterior.nc in the directory of the result.

        Raises:
            InputError: There is none, because the posterior was not sampled.
        """
        if not self.has_posterior:
            raise InputError(
                "has no posterior.nc in its directory; repeat the fit without --no-posterior",
                file=str(self.path),
            )
        return nullcontext(self.path.with_name("posterior.nc"))

    def draws(self, most: int = _MOST_DRAWS) -> dict[str, Array]:
        """Draws of the posterior, thinned evenly.

        Without a posterior.nc, normal draws of the seven nominal parameters follow from their
        medians, standard deviations and correlations.

        Args:
            most: Largest number of draws.

        Raises:
            InputError: The posterior cannot be read, or the result lacks a parameter.
        """
        if not self.has_posterior:
            return normal_draws(self.result, most, str(self.path))
        posterior = self.path.with_name("posterior.nc")
        try:
            if not posterior.is_file():
                raise OSError("not a regular file")
            with posterior.open("rb") as content:
                draws = chain_draws(content, most, str(posterior))
        except OSError as error:
            raise _no_posterior(posterior, error) from error
        check_same_fit(self.result, draws, str(posterior))
        return draws


def read_result(path: str | os.PathLike[str]) -> StoredResult:
    """Read the result of an earlier identification.

    Args:
        path: result.json, or the directory that contains it.

    Raises:
        InputError: The file cannot be read or is not a result of ``motorid fit``.
    """
    file = Path(path)
    if file.is_dir():
        file = file / "result.json"
    try:
        # Opening a FIFO without a writer would block.
        if file.exists() and not file.is_file():
            raise OSError(errno.EINVAL, "Not a regular file")
        text = file.read_bytes().decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError("is not text; expected a result.json", file=str(file)) from error
    except OSError as error:
        raise UnreadableFile(
            f"cannot be opened ({error.strerror}); expected a result.json of 'motorid fit'",
            file=str(file),
        ) from error
    try:
        content = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise InputError(
            "is not JSON; expected a result.json of 'motorid fit'",
            file=str(file),
            row=getattr(error, "lineno", None),
        ) from error
    version = content.get("schema_version") if isinstance(content, dict) else None
    if version != 1 or not isinstance(content.get("parameters"), dict):
        raise InputError(
            f"has schema_version {version!r}; expected a result.json of 'motorid fit' with "
            "schema_version 1",
            file=str(file),
        )
    return StoredResult(content, file)


def feedback(
    motor: Identified | Mapping[str, ArrayLike],
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


def inference_data(source: Identified | str | os.PathLike[str]) -> Any:
    """Posterior as the object of ArviZ, each walker a chain.

    Args:
        source: What `identify` or `read_result` returns, the directory of a result, or a
            posterior.nc.

    Returns:
        ``arviz.InferenceData`` with ArviZ 0.x, ``xarray.DataTree`` with ArviZ 1.x; groups
        ``posterior``, with the unit of each variable, and ``sample_stats``.

    Raises:
        MissingPackage: ArviZ is not installed.
        InputError: The posterior was not sampled, or the file is none.
    """
    try:
        arviz, xarray = import_module("arviz"), import_module("xarray")
    except ImportError as error:
        raise MissingPackage(
            "inference_data needs ArviZ, which is not installed; type: pip install arviz"
        ) from error
    with _posterior(source) as path:
        try:
            with path.open("rb") as content:
                check_heaps(content)
            groups = {
                group: xarray.load_dataset(path, group=group, engine="h5netcdf")
                for group in ("posterior", "sample_stats")
            }
        except (LookupError, OSError, RuntimeError, TypeError, ValueError) as error:
            raise _no_posterior(path, error) from error
    if hasattr(arviz, "InferenceData"):
        return arviz.InferenceData(**groups)
    return xarray.DataTree.from_dict(groups)


def _draws(motor: Identified | Mapping[str, ArrayLike]) -> Mapping[str, ArrayLike]:
    if isinstance(motor, Mapping):
        if "schema_version" in motor:
            raise InputError(
                "motor is the content of a result.json, which has no draws; expected what identify "
                "or read_result returns, or the parameters by name"
            )
        return motor
    if not isinstance(motor, Identified):
        raise InputError(
            f"motor is a {type(motor).__name__}; expected what identify or read_result returns, or "
            "the parameters by name"
        )
    return motor.draws()


def _posterior(source: Identified | str | os.PathLike[str]) -> AbstractContextManager[Path]:
    if isinstance(source, Identified):
        return source.posterior_file()
    path = Path(source)
    return nullcontext(path) if path.suffix == ".nc" else read_result(path).posterior_file()


def _no_posterior(path: Path, error: Exception) -> InputError:
    return InputError(
        f"is not a posterior of 'motorid fit' ({error}); repeat the fit or remove the file",
        file=str(path),
    )


def _parameters_html(table: pd.DataFrame) -> str:
    """Table of the parameters with the digits that their intervals support."""
    rows = []
    for name, entry in table.iterrows():
        text = interval_text(entry["median"], entry["q05"], entry["q95"])
        rows.append(
            {
                "parameter": name,
                "median": text.median + text.power,
                "90 % interval": f"{text.low} to {text.high}{text.power}",
                "unit": unit_text(entry["unit"]),
                "identified": "yes" if entry["identified"] else "no",
            }
        )
    html: str = pd.DataFrame(rows).to_html(index=False)
    return html
