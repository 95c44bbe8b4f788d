"""Batch identification on a service: upload runs, submit batches, fetch results.

    DIR/service.json       the batch request, written before it is sent

The file holds the complete request with its Idempotency-Key.  If the command is killed at any
moment and given again, it resumes its batch and submits none twice.
"""

from __future__ import annotations

import hashlib
import json
import time
import uuid
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final

from app.batches import MOST_MOTORS, MOST_RUNS
from app.commands.batch.local import MotorJob
from app.commands.batch.manifest import unopened
from app.commands.batch.record import finish, make_way, previous_refit, remember
from identification.errors import ComputationError, InputError
from identification.result.atomic import write_text
from motorid.client import BadKey, Batch, Client, ClientError, NotFound, Refused, Run

__all__ = ["fit_all_at"]

_STATE: Final = "service.json"
_MOST_MOTORS: Final = MOST_MOTORS // 2  # the request body has a size limit, too
_TOO_MANY: Final = "quota_batch"
_FIRST_LOOK_S: Final = 0.2
_SLOWEST_LOOK_S: Final = 5.0

Tell = Callable[[str, str, float], None]


@contextmanager
def reached(url: str, key: str | None, first_s: float, later_s: float) -> Iterator[Client]:
    """Yield a client of a service that has answered at least once.

    The first call is retried over `first_s`, each later one over `later_s` [s].

    Raises:
        InputError: The service rejects the key or refuses a call for another reason.
        ComputationError: The service does not answer.
    """
    try:
        with Client(url, key, patience_s=first_s) as first:
            next(first.batches(), None)
        with Client(url, key, patience_s=later_s) as service:
            yield service
    except BadKey as error:
        raise InputError(f"--key: {error}") from error
    except (NotFound, Refused, ValueError) as error:
        raise InputError(f"--server {url}: {error}") from error
    except ClientError as error:
        raise ComputationError(
            f"{error}; the service continues its fits; repeat the command to resume the batch"
        ) from error


def fit_all_at(
    service: Client, out: Path, name: str, jobs: Sequence[MotorJob], tell: Tell
) -> Iterator[tuple[MotorJob, str]]:
    """Fit motors on a service; yield each job with its error message, or "" on success."""
    left = list(jobs)
    most = _MOST_MOTORS
    sent: dict[str, dict[str, Any]] = {}
    while left:
        state = _state(out, service.url, left)
        if state is None:
            fresh: list[tuple[MotorJob, dict[str, Any]]] = []
            while left and _has_place(fresh, left[0], most):
                job = left.pop(0)
                entry, reason = sent.pop(job.motor.name, None), ""
                if entry is None:
                    entry, reason = _uploaded(service, job, tell)
                if entry is None:
                    yield job, reason
                else:
                    fresh.append((job, entry))
            if not fresh:
                continue
            state = _new_state(out, service.url, name, fresh)
            mine = [job for job, _ in fresh]
        else:
            mine = [job for job in left if _is_in(state, job)]
            left = [job for job in left if job not in mine]
        if (batch := _begun(service, state)) is None:
            # The batch exceeds the queue quota: submit the uploaded runs in batches of
            # half the size.
            most = len(state["motors"]) // 2
            names = {job.motor.name for job in mine}
            sent |= {entry["motor"]: entry for entry in state["motors"] if entry["motor"] in names}
            left = [*mine, *left]
        elif isinstance(batch, str):
            yield from ((job, batch) for job in mine)
        else:
            yield from _followed(service, batch, mine, tell)
        (out / _STATE).unlink(missing_ok=True)


def _has_place(fresh: Sequence[tuple[MotorJob, object]], job: MotorJob, most: int) -> bool:
    """Return True if one more motor fits into a batch; the first one always does."""
    motors = [job.motor, *(one.motor for one, _ in fresh)]
    runs = sum(len(motor.training) + len(motor.validation) for motor in motors)
    return not fresh or (len(motors) <= most and runs <= MOST_RUNS)


def _begun(service: Client, state: Mapping[str, Any]) -> Batch | str | None:
    """Submit a batch; return it, the reason for a refusal, or None if it must be split."""
    try:
        return service.batch(
            state["motors"], name=state["name"], idempotency_key=state["idempotency_key"]
        )
    except (NotFound, Refused) as error:
        if error.code == _TOO_MANY and len(state["motors"]) > 1:
            return None
        # Runs were deleted in the meantime, or this service never had them.
        return f"the service refused the batch: {error}"


def _followed(
    service: Client, batch: Batch, jobs: Sequence[MotorJob], tell: Tell
) -> Iterator[tuple[MotorJob, str]]:
    """Poll a batch and yield each job when its fit has ended."""
    waiting = {job.motor.name: job for job in jobs}
    pause = _FIRST_LOOK_S
    while waiting:
        ended = _ended(batch, waiting, tell)
        for fit in ended:
            job = waiting.pop(fit["motor"])
            yield job, _taken(service, job, fit)
        if not waiting:
            return
        pause = _FIRST_LOOK_S if ended else min(1.3 * pause, _SLOWEST_LOOK_S)
        time.sleep(pause)
        try:
            batch = service.show_batch(batch)
        except NotFound:
            gone = "its batch was removed from the service; repeat the command"
            yield from ((job, gone) for job in waiting.values())
            return
        if batch.has_ended and not {fit["motor"] for fit in batch.fits} & set(waiting):
            gone = "its fit was removed from the service; repeat the command"
            yield from ((job, gone) for job in waiting.values())
            return


def _ended(batch: Batch, waiting: Mapping[str, MotorJob], tell: Tell) -> list[Mapping[str, Any]]:
    ended = []
    for fit in batch.fits:
        if fit["motor"] not in waiting:
            continue
        if fit["status"] in ("succeeded", "failed", "cancelled"):
            ended.append(fit)
        elif fit["status"] == "running":
            tell(fit["motor"], fit["progress"]["stage"], fit["progress"]["fraction"])
    return ended


def _taken(service: Client, job: MotorJob, fit: Mapping[str, Any]) -> str:
    """Write the result of an ended fit; return the error message, or "" on success."""
    if fit["status"] != "succeeded":
        error = fit.get("error") or {}
        return str(error.get("detail") or f"{fit['fit']} was {fit['status']} at the service")
    shown = service.show_fit(fit["fit"])
    job.out.mkdir(parents=True, exist_ok=True)
    make_way(job.out)
    _remember_earlier(service, job, shown.content)
    service.fetch(shown, job.out)
    finish(job.out, {**job.record, "fit": shown.id}, shown.content["ended_at"])
    return ""


def _remember_earlier(service: Client, job: MotorJob, fit: Mapping[str, Any]) -> None:
    """Copy the previous result of a motor from the service if the local history is empty."""
    if previous_refit(job.motor.name, job.out) is not None:
        return
    for earlier in service.fits(status="succeeded", motor=job.motor.name):
        if earlier.content["created_at"] < fit["created_at"]:
            shown = service.show_fit(earlier)
            if shown.result is not None:
                record = {"ended_at": shown.content["ended_at"], "fit": shown.id}
                remember(job.out, record, shown.result)
            return


def _uploaded(service: Client, job: MotorJob, tell: Tell) -> tuple[dict[str, Any] | None, str]:
    """Upload the runs of a motor; return its request entry, or None and the error message."""
    motor = job.motor
    tell(motor.name, "upload", 0.0)
    try:
        mapping = motor.mapping.read_text(encoding="utf-8-sig") if motor.mapping else None
        runs: dict[str, list[Run]] = {
            role: [service.upload(file, motor=motor.name, mapping=mapping) for file in files]
            for role, files in (("training", motor.training), ("validation", motor.validation))
        }
    except Refused as error:
        return None, str(error)
    except OSError as error:
        return None, unopened(error)
    options = {k: list(v) if isinstance(v, tuple) else v for k, v in asdict(motor.options).items()}
    options |= {"bench": motor.bench} if motor.bench else {}
    ids = {role: [run.id for run in stored] for role, stored in runs.items()}
    return {"motor": motor.name, **ids, "options": options}, ""


def _new_state(
    out: Path, url: str, name: str, motors: Sequence[tuple[MotorJob, dict[str, Any]]]
) -> dict[str, Any]:
    state = {
        "url": url,
        "idempotency_key": uuid.uuid4().hex,
        "name": name,
        "motors": [entry for _, entry in motors],
        "records": {job.motor.name: _hash(job.record) for job, _ in motors},
    }
    write_text(out / _STATE, json.dumps(state, indent=1) + "\n")
    return state


def _state(out: Path, url: str, jobs: Sequence[MotorJob]) -> dict[str, Any] | None:
    """Request of an earlier command in this directory, if it contains one of these jobs."""
    try:
        state = json.loads((out / _STATE).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    if not isinstance(state, dict) or state.get("url") != url:
        return None
    return state if any(_is_in(state, job) for job in jobs) else None


def _is_in(state: Mapping[str, Any], job: MotorJob) -> bool:
    return bool(state["records"].get(job.motor.name) == _hash(job.record))


def _hash(record: Mapping[str, Any]) -> str:
    return hashlib.sha256(json.dumps(record, sort_keys=True).encode()).hexdigest()
