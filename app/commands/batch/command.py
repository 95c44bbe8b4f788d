"""`motorid batch`: fit every motor of a manifest; write a table and a page of the results.

    DIR/MOTOR/             output of `motorid fit` for each motor
    DIR/results.csv        one row per motor; results.parquet has the same content
    DIR/pooled.csv         one row per motor and pooled quantity
    DIR/fleet.html         all motors on one page

A motor is not fitted again if its result was made from the same runs with the same options,
so an interrupted batch is resumed by giving the same command again.  A failed motor does not
stop the others.
"""

from __future__ import annotations

import fcntl
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

from app.commands import console
from app.commands.batch.local import MotorJob, fit_all
from app.commands.batch.manifest import Motor, read_manifest
from app.commands.batch.record import kept_result, previous_refit, record_of
from app.commands.files import writable_directory
from identification.errors import ComputationError, InputError, OptionError
from identification.fleet.refit import Refit, compared_with, refit_of
from identification.fleet.table import (
    POOLED_COLUMNS,
    MissingParquet,
    csv_text,
    parquet_bytes,
    pooled_rows,
    rows_of,
)
from identification.options import FitOptions
from identification.quantities import DECLARED_PARAMETERS
from identification.result.atomic import replacing, write_text

__all__ = ["run_batch"]

_TABLE_EVERY_S = 2.0
# Fail fast on a wrong URL; tolerate a restart of the service.
_FIRST_PATIENCE_S = 60.0
_PATIENCE_S = 600.0


def run_batch(
    manifest: Path,
    out: Path,
    options: FitOptions,
    *,
    at_once: int,
    server: str | None = None,
    key: str | None = None,
    output: console.Output,
) -> None:
    """Fit every motor of a manifest, whose options take precedence over the given ones.

    Raises:
        InputError: The manifest or the directory is invalid.
        ComputationError: At least one motor failed; the table gives the reasons.
    """
    motors = read_manifest(manifest, options)
    with writable_directory(out), _alone_in(out), console.progress_bar(output.quiet) as progress:
        batch = _Batch(motors, out, progress)
        try:
            jobs = batch.begin()
            if server is None:
                batch.take(fit_all(jobs, at_once, batch.tell))
            else:
                from app.commands.batch.remote import fit_all_at, reached

                with reached(server, key, _FIRST_PATIENCE_S, _PATIENCE_S) as service:
                    batch.take(fit_all_at(service, out, manifest.name, jobs, batch.tell))
        finally:
            batch.write_table()
        remark = batch.write_all(manifest.stem)
    if remark and not output.quiet:
        console.remark(remark)
    rows = rows_of(batch.refits)
    output.show(rows, lambda: _print(rows, batch.refits))
    failed = [refit.motor for refit in batch.refits if refit.status == "failed"]
    if failed:
        raise ComputationError(
            f"{len(failed)} of {len(motors)} motors failed ({', '.join(failed[:5])}"
            f"{', ...' if len(failed) > 5 else ''}); the column `error` of {out / 'results.csv'} "
            "gives the reasons"
        )


def _print(rows: Sequence[Mapping[str, Any]], refits: Sequence[Refit]) -> None:
    console.print_rows(["motor", "status", *DECLARED_PARAMETERS, "warnings"], rows)
    for refit in refits:
        if refit.error:
            line = f"{refit.motor}: {refit.error}"
            console.results_console().print(line, style="red", soft_wrap=True)


class _Batch:
    """Motors in manifest order with the results obtained so far."""

    def __init__(self, motors: Sequence[Motor], out: Path, progress: console.Progress) -> None:
        self._motors = motors
        self._out = out
        self._progress = progress
        self._shares: dict[str, float] = {}
        self._found: dict[str, Refit] = {}
        self._written_at = 0.0

    @property
    def refits(self) -> list[Refit]:
        """Results obtained so far, in manifest order."""
        names = (motor.name for motor in self._motors)
        return [self._found[name] for name in names if name in self._found]

    def begin(self) -> list[MotorJob]:
        """Return the jobs that are still to be fitted; results that are up to date are kept."""
        for rest in (*self._out.glob(".results.*.part"), *self._out.glob(".fleet.html.*.part")):
            rest.unlink(missing_ok=True)
        jobs = []
        for motor in self._motors:
            try:
                job = MotorJob(motor, record_of(motor), self._out / motor.name)
            except InputError as error:
                self._failed(motor.name, str(error))
                continue
            if not self._read(job, "kept"):
                jobs.append(job)
        self._shares = dict.fromkeys(self._found, 1.0)
        return jobs

    def tell(self, motor: str, stage: str, share: float) -> None:
        """Report the stage and the completed fraction of one fit as progress of the batch."""
        self._shares[motor] = share
        total = len(self._motors)
        words = f"{len(self._found)}/{total}  {motor}: {stage}"
        self._progress(words, sum(self._shares.values()) / total)

    def take(self, ended: Iterator[tuple[MotorJob, str]]) -> None:
        """Record the outcome of each fit, and rewrite the table at intervals."""
        for job, reason in ended:
            if reason:
                self._failed(job.motor.name, reason)
            elif not self._read(job, "fitted"):
                self._failed(
                    job.motor.name, f"{job.out / 'result.json'} was changed by another process"
                )
            self.tell(job.motor.name, "done", 1.0)
            if time.monotonic() - self._written_at > _TABLE_EVERY_S:
                self.write_table()

    def write_table(self) -> None:
        """Write results.csv with the results obtained so far."""
        write_text(self._out / "results.csv", csv_text(rows_of(self.refits)))
        self._written_at = time.monotonic()

    def write_all(self, title: str) -> str:
        """Write the page and the other tables; return a note if Parquet is not available."""
        from identification.fleet.page import render_fleet

        write_text(self._out / "fleet.html", render_fleet(title, self.refits))
        pooled = csv_text(pooled_rows(self.refits), POOLED_COLUMNS)
        write_text(self._out / "pooled.csv", pooled)
        try:
            content = parquet_bytes(rows_of(self.refits))
        except MissingParquet as error:
            (self._out / "results.parquet").unlink(missing_ok=True)
            return f"results.parquet was not written: {error}"
        with replacing(self._out / "results.parquet") as neighbour:
            neighbour.write_bytes(content)
        return ""

    def _read(self, job: MotorJob, status: str) -> bool:
        """Load the stored result of a job if it is up to date; return whether it is."""
        found = kept_result(job.out, job.record)
        if found is None:
            return False
        result, ended_at = found
        name = job.motor.name
        refit = replace(
            refit_of(name, status, result),
            fit=name,
            ended_at=ended_at,
            link=f"{name}/report.html",
            type=job.motor.type,
        )
        self._found[name] = compared_with(refit, previous_refit(name, job.out))
        return True

    def _failed(self, name: str, reason: str) -> None:
        self._found[name] = Refit(name, "failed", error=" ".join(reason.split()))


@contextmanager
def _alone_in(out: Path) -> Iterator[None]:
    """Hold an exclusive lock on the output directory; raise `OptionError` if another batch does."""
    with (out / ".lock").open("ab") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            raise OptionError(
                f"--out {out}: another batch is writing to it; wait until it ends, or "
                "choose another directory"
            ) from error
        yield
