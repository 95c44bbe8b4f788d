"""`motorid batch`: every motor of a manifest, a table and a page of all of them.

    DIR/MOTOR/             what `motorid fit` writes, for each motor
    DIR/results.csv        a row for each motor; results.parquet the same
    DIR/fleet.html         all motors on one page

A motor whose result was made from the same runs with the same options is not fitted again, so a
batch that was interrupted is taken up by giving the same command again.  One bad motor does not
stop the others.
"""

from __future__ import annotations

import fcntl
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from app import console
from app.batch.local import Job, fit_all
from app.batch.manifest import Motor, read_manifest
from app.batch.record import kept_result, previous_refit, record_of
from app.commands import Show
from app.outputs import writable_directory
from identification.errors import ComputationError, InputError, OptionError
from identification.fleet.refit import Refit, compared_with, refit_of
from identification.fleet.table import MissingParquet, csv_text, parquet_bytes, rows_of
from identification.options import FitOptions
from identification.quantities import DECLARED_PARAMETERS
from identification.report.atomic import replacing, write_text

__all__ = ["run_batch"]

_TABLE_EVERY_S = 2.0
# A wrong address shall not cost ten minutes, and a service that is started anew not the batch.
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
    show: Show,
) -> None:
    """Fit every motor of a manifest.

    Args:
        manifest: The manifest.
        out: Directory that gets a directory for each motor, the table and the page.
        options: Options of motors about which the manifest says nothing else.
        at_once: How many motors at the same time.
        server: Address of a service that fits them; on this machine where not given.
        key: Key of that service.
        show: What goes to standard output.

    Raises:
        InputError: The manifest or the directory is at fault.
        ComputationError: Motors failed; the table says which and why.
    """
    motors = read_manifest(manifest, options)
    with writable_directory(out), _alone_in(out), console.progress_bar(show.quiet) as progress:
        batch = _Batch(motors, out)
        try:
            jobs = batch.begin()
            tell = _Teller(progress, batch)
            if server is None:
                batch.take(fit_all(jobs, at_once, tell), tell)
            else:
                from app.batch.remote import fit_all_at, reached

                with reached(server, key, _FIRST_PATIENCE_S, _PATIENCE_S) as service:
                    batch.take(fit_all_at(service, out, manifest.name, jobs, tell), tell)
        finally:
            batch.write_table()
        remark = batch.write_all(manifest.stem)
    if remark and not show.quiet:
        console.remark(remark)
    rows = rows_of(batch.refits)
    if show.as_json:
        console.print_json(rows)
    elif not show.quiet:
        console.print_rows(["motor", "status", *DECLARED_PARAMETERS, "warnings"], rows)
    failed = [refit.motor for refit in batch.refits if refit.status == "failed"]
    if failed:
        raise ComputationError(
            f"{len(failed)} of {len(motors)} motors failed ({', '.join(failed[:5])}"
            f"{', ...' if len(failed) > 5 else ''}); {out / 'results.csv'} says why"
        )


class _Batch:
    """Motors in the order of the manifest, and what became of them so far."""

    def __init__(self, motors: Sequence[Motor], out: Path) -> None:
        self._motors = motors
        self._out = out
        self._found: dict[str, Refit] = {}
        self._written_at = 0.0
        self.total = len(motors)

    @property
    def refits(self) -> list[Refit]:
        """What is known, in the order of the manifest."""
        names = (motor.name for motor in self._motors)
        return [self._found[name] for name in names if name in self._found]

    def begin(self) -> list[Job]:
        """What is left to fit; results that are still true are taken as they are."""
        for rest in (*self._out.glob(".results.*.part"), *self._out.glob(".fleet.html.*.part")):
            rest.unlink(missing_ok=True)
        jobs = []
        for motor in self._motors:
            try:
                job = Job(motor, record_of(motor), self._out / motor.name)
            except InputError as error:
                self._failed(motor.name, str(error))
                continue
            if not self._read(job, "kept"):
                jobs.append(job)
        return jobs

    def take(self, ended: Iterator[tuple[Job, str]], tell: _Teller) -> None:
        """Note how each fit ended, and write the table from time to time."""
        for job, reason in ended:
            if reason:
                self._failed(job.motor.name, reason)
            elif not self._read(job, "fitted"):
                self._failed(job.motor.name, f"{job.out / 'result.json'} was changed by another")
            tell.ended(job.motor.name)
            if time.monotonic() - self._written_at > _TABLE_EVERY_S:
                self.write_table()

    def write_table(self) -> None:
        """Write results.csv with what is known."""
        write_text(self._out / "results.csv", csv_text(rows_of(self.refits)))
        self._written_at = time.monotonic()

    def write_all(self, title: str) -> str:
        """Write the table as Parquet and the page; gives a remark where one was not written."""
        from identification.fleet.page import render_fleet

        write_text(self._out / "fleet.html", render_fleet(title, self.refits))
        try:
            content = parquet_bytes(rows_of(self.refits))
        except MissingParquet as error:
            (self._out / "results.parquet").unlink(missing_ok=True)
            return f"results.parquet was not written: {error}"
        with replacing(self._out / "results.parquet") as neighbour:
            neighbour.write_bytes(content)
        return ""

    def _read(self, job: Job, status: str) -> bool:
        """Take the result of a directory, if it was made from what the motor's record says."""
        found = kept_result(job.out, job.record)
        if found is None:
            return False
        result, ended_at = found
        name = job.motor.name
        link = f"{name}/report.html"
        refit = refit_of(name, status, result, fit=name, ended_at=ended_at, link=link)
        self._found[name] = compared_with(refit, previous_refit(name, job.out))
        return True

    def _failed(self, name: str, reason: str) -> None:
        self._found[name] = Refit(name, "failed", error=" ".join(reason.split()))


class _Teller:
    """Progress of one fit as progress of the batch."""

    def __init__(self, progress: console.Progress, batch: _Batch) -> None:
        self._progress = progress
        self._batch = batch
        self._shares: dict[str, float] = {}
        self._kept = len(batch.refits)

    def __call__(self, motor: str, stage: str, share: float) -> None:
        """A fit has come to a stage."""
        self._shares[motor] = share
        self._tell(f"{motor}: {stage}")

    def ended(self, motor: str) -> None:
        """A fit has ended."""
        self._shares[motor] = 1.0
        self._tell(f"{motor}: done")

    def _tell(self, words: str) -> None:
        ended = len(self._batch.refits)
        share = (self._kept + sum(self._shares.values())) / self._batch.total
        self._progress(f"{ended}/{self._batch.total}  {words}", share)


@contextmanager
def _alone_in(out: Path) -> Iterator[None]:
    """Hold the directory, so that no second batch writes into it meanwhile.

    Raises:
        OptionError: Another one does.
    """
    with (out / ".lock").open("ab") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            raise OptionError(
                f"--out {out}: another batch writes there; wait for it or name another directory"
            ) from error
        yield
