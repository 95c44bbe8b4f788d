"""Client of the service for scripts.

    from motorid.client import Client

    service = Client("http://127.0.0.1:8000", key)
    run = service.upload("training_1.csv", motor="motor 17")
    fit = service.wait(service.fit([run]))
    service.fetch(fit, "out/motor-17")

Calls without a response, or with a temporary error, are repeated for some time.  A repetition has
no second effect: the same bytes are the same run, and each fit and batch has an Idempotency-Key.
A client may be used by several threads.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Self
from urllib.parse import quote, urlencode

from motorid.calls import Calls
from motorid.errors import (
    BadKey,
    Busy,
    ClientError,
    FitFailed,
    NotFound,
    Problem,
    Refused,
    Unreachable,
    WaitedTooLong,
)
from motorid.files import Source, replacing
from motorid.things import Batch, FitState, Run
from motorid.transport import Transport
from motorid.waiting import Tell, until_ended

__all__ = [
    "BadKey",
    "Batch",
    "Busy",
    "Client",
    "ClientError",
    "FitState",
    "FitFailed",
    "NotFound",
    "Problem",
    "Refused",
    "Run",
    "Unreachable",
    "WaitedTooLong",
]

_ROLES = ("training", "validation")
_TABLES = {
    ".csv": "text/csv",
    ".json": "application/json",
    ".parquet": "application/vnd.apache.parquet",
}


class Client:
    """Client of one service.

    Args:
        url: URL of the service.
        key: Key from ``motorid keys create``; None if the service requires none.
        patience_s: Time over which a call without a response is repeated [s].
        timeout_s: Time limit for each part of a response [s].

    Raises:
        ValueError: The URL is invalid.
    """

    def __init__(
        self,
        url: str,
        key: str | None = None,
        *,
        patience_s: float = 60.0,
        timeout_s: float = 60.0,
    ) -> None:
        transport = Transport(url, key, patience_s, timeout_s)
        self._calls = Calls(transport)
        self.url = transport.url

    def __enter__(self) -> Self:
        """Return the client."""
        return self

    def __exit__(self, *error: object) -> None:
        """Close the connections."""
        self.close()

    def close(self) -> None:
        """Close the connections."""
        self._calls.transport.close()

    def upload(
        self,
        source: Source,
        *,
        name: str | None = None,
        motor: str | None = None,
        mapping: Mapping[str, object] | str | None = None,
    ) -> Run:
        """Store a run; the same bytes with the same mapping are the same run.

        Args:
            source: Path of a file, or its content as bytes.
            name: Name of the run; default: the name of the file.
            motor: Name of the motor.
            mapping: Assignment of columns to channels, if the header does not give it.
        """
        fields = {} if motor is None else {"motor": motor}
        if mapping is not None:
            fields["mapping"] = mapping if isinstance(mapping, str) else json.dumps(mapping)
        return Run.of(self._calls.upload("/runs", source, name, fields))

    def fit(
        self,
        training: Sequence[Run | str],
        validation: Sequence[Run | str] = (),
        *,
        motor: str | None = None,
        options: Mapping[str, Any] | None = None,
        idempotency_key: str | None = None,
    ) -> FitState:
        """Submit a fit.

        Args:
            training: Runs to fit, or their ids, in the order of recording.
            validation: Validation runs, or their ids.
            motor: Name of the motor.
            options: `seed`, `posterior`, `effects`, `hold`, `temperatures`, `controllers`,
                `effort`, `time_limit`, `set_aside`, `force`,
                `known`, `nameplate`.
            idempotency_key: Key under which the same request is the same fit; default: a new key
                for each call.
        """
        body = {
            "training": [_id(run) for run in training],
            "validation": [_id(run) for run in validation],
            "options": dict(options or {}),
            "motor": motor,
        }
        return FitState.of(self._calls.begin("/fits", body, idempotency_key))

    def batch(
        self,
        motors: Sequence[Mapping[str, Any]],
        *,
        options: Mapping[str, Any] | None = None,
        name: str | None = None,
        idempotency_key: str | None = None,
    ) -> Batch:
        """Submit one fit for each of many motors.

        Args:
            motors: Entries with `motor`, `training`, and optionally `type`, `validation` and
                `options`.
            options: Options of each motor without its own.
            name: Name in lists.
            idempotency_key: As for `fit`.
        """
        asked = [
            {**motor, **{role: [_id(run) for run in motor.get(role, ())] for role in _ROLES}}
            for motor in motors
        ]
        body = {"motors": asked, "options": dict(options or {}), "name": name}
        return Batch.of(self._calls.begin("/batches", body, idempotency_key))

    def wait(
        self,
        fit: FitState | str,
        *,
        timeout_s: float | None = None,
        progress: Tell | None = None,
    ) -> FitState:
        """Wait until a fit has succeeded, and return it with its result.

        Args:
            fit: The fit, or its id.
            timeout_s: Time limit [s]; default: none.
            progress: Called with stage and completed fraction when they change.

        Raises:
            FitFailed: The fit failed or was cancelled.
            WaitedTooLong: The time limit is exceeded; the fit continues.
        """

        def told(now: FitState) -> tuple[str, float]:
            return now.stage, now.fraction

        ended = until_ended(lambda: self.show_fit(fit), told, timeout_s, progress)
        if ended.status != "succeeded":
            raise FitFailed(ended.id, ended.status, ended.error)
        return ended

    def wait_batch(
        self,
        batch: Batch | str,
        *,
        timeout_s: float | None = None,
        progress: Tell | None = None,
    ) -> Batch:
        """Wait until all fits of a batch have ended, and return the batch.

        Args:
            batch: The batch, or its id.
            timeout_s: Time limit [s]; default: none.
            progress: Called with the number of ended fits and the completed fraction.

        Raises:
            WaitedTooLong: The time limit is exceeded; the batch continues.
        """

        def told(now: Batch) -> tuple[str, float]:
            waiting = now.counts.get("queued", 0) + now.counts.get("running", 0)
            total = sum(now.counts.values())
            return f"{total - waiting} of {total} motors", now.fraction

        return until_ended(lambda: self.show_batch(batch), told, timeout_s, progress)

    def fetch(self, fit: FitState | str, directory: str | os.PathLike[str]) -> dict[str, Path]:
        """Write result.json, report.html and, if there is one, posterior.nc.

        Args:
            fit: Succeeded fit, or its id.
            directory: Output directory; created if missing.

        Returns:
            Path of each file by `result`, `report` and `posterior`.
        """
        shown = fit if isinstance(fit, FitState) and fit.result is not None else self.show_fit(fit)
        if shown.result is None:
            raise FitFailed(shown.id, shown.status, shown.error)
        folder = Path(directory)
        files = {"result": folder / "result.json"}
        with replacing(files["result"]) as file:
            text = json.dumps(shown.result, indent=2, allow_nan=False, ensure_ascii=False)
            file.write(f"{text}\n".encode())
        files["report"] = self.fetch_report(shown, folder / "report.html")
        posterior = folder / "posterior.nc"
        if "posterior" in shown.content["links"]:
            files["posterior"] = self.fetch_posterior(shown, posterior)
        else:
            # The posterior of an earlier fit does not belong to this result.
            posterior.unlink(missing_ok=True)
        return files

    def fetch_report(self, fit: FitState | str, path: str | os.PathLike[str]) -> Path:
        """Write the report of a succeeded fit; return the path."""
        return self._calls.fetched(f"/fits/{_id(fit)}/report", Path(path))

    def fetch_posterior(self, fit: FitState | str, path: str | os.PathLike[str]) -> Path:
        """Write the posterior of a succeeded fit that was sampled; return the path."""
        return self._calls.fetched(f"/fits/{_id(fit)}/posterior", Path(path))

    def fetch_export(
        self,
        fit: FitState | str,
        form: str,
        path: str | os.PathLike[str],
        *,
        temperatures: Sequence[float] = (),
    ) -> Path:
        """Write the motor of a succeeded fit in the format of another program; return the path.

        Args:
            fit: The fit, or its id.
            form: Format, such as ``matlab``, ``modelica``, ``fmu`` or ``csv``.
            path: File to write.
            temperatures: Temperatures of linear models [degC]; those of the result if empty.
        """
        chosen = urlencode([("temperature", one) for one in temperatures])
        return self._calls.fetched(
            f"/fits/{_id(fit)}/exports/{quote(form, safe='')}?{chosen}", Path(path)
        )

    def fetch_table(self, batch: Batch | str, path: str | os.PathLike[str]) -> Path:
        """Write the results table of a batch in the format given by the suffix of the path.

        Args:
            batch: The batch, or its id.
            path: File name that ends with ``.csv``, ``.json`` or ``.parquet``.
        """
        target = Path(path)
        if target.suffix not in _TABLES:
            raise ValueError(
                f"{target.name!r} has no suffix of a table format; expected a name that ends with "
                f"{', '.join(_TABLES)}"
            )
        return self._calls.fetched(f"/batches/{_id(batch)}/results", target, _TABLES[target.suffix])

    def fetch_fleet(self, batch: Batch | str, path: str | os.PathLike[str]) -> Path:
        """Write the fleet page of a batch; return the path."""
        return self._calls.fetched(f"/batches/{_id(batch)}/report", Path(path))

    def show_run(self, run: Run | str) -> Run:
        """Stored run."""
        return Run.of(self._calls.get(f"/runs/{_id(run)}"))

    def show_fit(self, fit: FitState | str) -> FitState:
        """Current state of a fit, with its result once it has succeeded."""
        return FitState.of(self._calls.get(f"/fits/{_id(fit)}"))

    def show_batch(self, batch: Batch | str) -> Batch:
        """Current state of a batch and of each of its fits."""
        return Batch.of(self._calls.get(f"/batches/{_id(batch)}"))

    def runs(self, *, motor: str | None = None) -> Iterator[Run]:
        """All runs, newest first; pages are requested on demand."""
        return map(Run.of, self._calls.listed("/runs", motor=motor))

    def fits(self, *, status: str | None = None, motor: str | None = None) -> Iterator[FitState]:
        """All fits, newest first, without their results."""
        return map(FitState.of, self._calls.listed("/fits", status=status, motor=motor))

    def batches(self) -> Iterator[Batch]:
        """All batches, newest first, without their fits."""
        return map(Batch.of, self._calls.listed("/batches"))

    def cancel(self, fit: FitState | str) -> FitState:
        """Cancel an unfinished fit; an ended one is left unchanged."""
        return FitState.of(self._calls.cancelled(f"/fits/{_id(fit)}"))

    def cancel_batch(self, batch: Batch | str) -> Batch:
        """Cancel the unfinished fits of a batch; ended ones are left unchanged."""
        return Batch.of(self._calls.cancelled(f"/batches/{_id(batch)}"))

    def delete_run(self, run: Run | str) -> None:
        """Remove a run; a missing run is not an error."""
        self._calls.deleted(f"/runs/{_id(run)}")

    def delete_fit(self, fit: FitState | str) -> None:
        """Remove a fit with its outputs; an unfinished one is cancelled first."""
        self._calls.deleted(f"/fits/{_id(fit)}")

    def delete_batch(self, batch: Batch | str) -> None:
        """Remove a batch with its fits; unfinished ones are cancelled first."""
        self._calls.deleted(f"/batches/{_id(batch)}")


def _id(thing: Run | FitState | Batch | str) -> str:
    return thing if isinstance(thing, str) else thing.id
