"""`motorid.client` with a real service, directly and through a faulty proxy."""

from __future__ import annotations

import json
import re
import threading
import time
from collections.abc import Callable, Iterator
from http.server import BaseHTTPRequestHandler
from pathlib import Path

import httpx
import pytest

from motorid import calls
from motorid.client import (
    BadKey,
    Busy,
    Client,
    FitFailed,
    NotFound,
    Problem,
    Refused,
    Unreachable,
    WaitedTooLong,
)
from motorid.transport import pause_s
from tests.app.faulty import Bad, lost, not_now
from tests.app.pretended import BAD_INPUT, SLOW
from tests.app.service import Caller, Server, make_key, run_text

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def key(server: Server) -> str:
    """Key of a workspace for the client tests."""
    return make_key(server.data_dir, "client")


@pytest.fixture(scope="module")
def service(server: Server, key: str) -> Iterator[Client]:
    """Client that retries a call for 20 s at most."""
    with Client(server.url, key, patience_s=20) as client:
        yield client


@pytest.fixture
def bad(server: Server) -> Iterator[Bad]:
    """Running proxy of the service."""
    way = Bad(server)
    thread = threading.Thread(target=way.serve_forever, args=(0.02,), daemon=True)
    thread.start()
    yield way
    way.shutdown()
    thread.join()
    way.server_close()


@pytest.mark.parametrize("page", ["README.md", "docs/client.md", "motorid/client.py"])
def test_documented_example_of_the_client_works(
    page: str, server: Server, key: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The five lines of the page run with the URL and the key of this server."""
    text = (ROOT / page).read_text(encoding="utf-8")
    found = re.search(
        r"( *)from motorid\.client import Client\n.*?service\.fetch[^\n]*", text, re.S
    )
    assert found
    lines = [line.removeprefix(found[1]) for line in found[0].splitlines() if line.strip()]
    assert len(lines) == 5
    (tmp_path / "training_1.csv").write_bytes(run_text(900))
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {"key": key}

    exec("\n".join(lines).replace("http://127.0.0.1:8000", server.url), names)

    assert isinstance(made := names["service"], Client)
    made.close()
    assert sorted(file.name for file in (tmp_path / "out/motor-17").iterdir()) == [
        "posterior.nc", "report.html", "result.json",
    ]  # fmt: skip
    assert json.loads((tmp_path / "out/motor-17/result.json").read_text())["schema_version"] == 1


def test_same_bytes_are_the_same_run_from_a_path_and_from_memory(
    service: Client, tmp_path: Path
) -> None:
    """Runs are identified by their content; the name is that of the file unless given."""
    path = tmp_path / "bench 7.csv"
    path.write_bytes(run_text(901))

    first = service.upload(path, motor="m 1")
    again = service.upload(path.read_bytes(), name="other.csv")

    assert (first.file, first.motor, first.rows) == ("bench 7.csv", "m 1", 60)
    assert again.id == first.id
    assert service.show_run(first) == first


def test_mapping_goes_with_the_run(service: Client) -> None:
    """The service applies the mapping that was uploaded with a run, here for a speed in rpm."""
    text = run_text(902).replace(b"speed_rad_s", b"n_ist")
    mapping = {"speed_rad_s": {"column": "n_ist", "unit": "rpm"}}

    with pytest.raises(Refused, match="n_ist|speed"):
        service.upload(text)

    assert service.upload(text, mapping=mapping).rows == 60


def test_errors_carry_the_members_of_the_problem(service: Client, server: Server) -> None:
    """The class follows from the status; file, row, column and code are attributes."""
    broken = run_text(903).replace(b"\n0.004000,", b"\n0.004x,")

    with pytest.raises(Refused) as refused:
        service.upload(broken, name="broken.csv")
    with pytest.raises(NotFound) as missing:
        service.show_fit("fit_" + "a" * 26)
    with Client(server.url, "motorid_wrong") as stranger, pytest.raises(BadKey):
        next(stranger.runs())

    error = refused.value
    assert (error.status, error.code, error.file, error.row, error.column) == (
        422, "not_a_number", "broken.csv", 6, "time_s",
    )  # fmt: skip
    assert str(error) == error.detail
    assert error.request_id
    assert isinstance(missing.value, Problem)
    assert missing.value.code == "not_found"


@pytest.mark.parametrize("faults", [[lost], [lost, lost], [not_now("0"), lost]])
def test_fit_whose_response_was_lost_is_submitted_once(
    bad: Bad, service: Client, key: str, faults: list[Callable[[BaseHTTPRequestHandler], None]]
) -> None:
    """Each lost response causes one repetition, and the service stores one fit."""
    run = service.upload(run_text(904))
    motor = f"motor {time.monotonic_ns()}"
    bad.faults = list(faults)

    with Client(bad.url, key) as client:
        fit = client.fit([run], motor=motor)

    assert bad.seen == ["POST"] * (len(faults) + 1)
    assert [one.id for one in service.fits(motor=motor)] == [fit.id]


def test_repeated_upload_sends_the_whole_file(
    bad: Bad, service: Client, key: str, tmp_path: Path
) -> None:
    """The second attempt rewinds a file that the first has read to its end."""
    path = tmp_path / "run.csv"
    path.write_bytes(run_text(905))
    bad.faults = [lost]

    with Client(bad.url, key) as client:
        assert client.upload(path).id == service.upload(path).id


def test_retry_after_is_obeyed(bad: Bad, key: str) -> None:
    """After a Retry-After of 1, the client waits at least one second."""
    bad.faults = [not_now("1")]
    began = time.monotonic()

    with Client(bad.url, key) as client:
        list(client.batches())

    assert time.monotonic() - began >= 1.0
    assert len(bad.seen) == 2


def test_retry_after_may_be_a_date() -> None:
    """RFC 9110, 10.2.3: seconds or a date; a past date means no wait."""

    def asked(value: str) -> float:
        return pause_s(1, httpx.Response(503, headers={"Retry-After": value}))

    assert asked("7") == 7.0
    assert asked("Wed, 21 Oct 2015 07:28:00 GMT") == 0.0
    assert asked("Wed, 21 Oct 2150 07:28:00 GMT") > 1e9
    assert asked("soon") <= 0.2


def test_pauses_double_up_to_a_limit() -> None:
    """The pause before retry k is 50 to 100 % of 0.2 s * 2^(k-1), at most 8 s."""
    for tried, longest in ((1, 0.2), (2, 0.4), (3, 0.8), (6, 6.4), (7, 8.0), (60, 8.0)):
        pauses = [pause_s(tried) for _ in range(50)]
        assert longest / 2 <= min(pauses) <= max(pauses) <= longest


def test_patience_ends(bad: Bad, key: str) -> None:
    """Retries end if Retry-After exceeds the remaining time or the service does not respond."""
    bad.faults = [not_now("3600")]
    with Client(bad.url, key, patience_s=1) as client, pytest.raises(Busy):
        client.show_batch("x")

    with (
        Client("http://127.0.0.1:9", patience_s=0.5) as client,
        pytest.raises(Unreachable, match=r"127\.0\.0\.1:9 does not answer"),
    ):
        client.show_batch("x")


def test_waiting_reports_progress_and_times_out(service: Client) -> None:
    """The fraction never decreases; for a fit of 2 s, a limit of 0.3 s is exceeded."""
    run = service.upload(run_text(906))
    fit = service.fit([run], options={"seed": SLOW})
    told: list[tuple[str, float]] = []

    with pytest.raises(WaitedTooLong, match=rf"{fit.id} is (queued|running) after 0\.3 s"):
        service.wait(fit, timeout_s=0.3)
    ended = service.wait(fit, progress=lambda stage, share: told.append((stage, share)))

    assert ended.result is not None
    assert [share for _, share in told] == sorted(share for _, share in told)
    assert told[-1] == ("done", 1.0)
    assert len(told) == len(set(told))


def test_failed_fit_reports_the_reason(service: Client, tmp_path: Path) -> None:
    """The exception carries file, row and column of the input error."""
    run = service.upload(run_text(907), name="stuck.csv")
    fit = service.fit([run], options={"seed": BAD_INPUT})

    with pytest.raises(FitFailed, match="the speed never moves") as failed:
        service.wait(fit)
    with pytest.raises(FitFailed):
        service.fetch(fit, tmp_path)

    error = failed.value
    assert (error.status, error.file, error.row, error.column) == (
        "failed", "stuck.csv", 7, "speed_rad_s",
    )  # fmt: skip
    assert list(tmp_path.iterdir()) == []


def test_fit_without_posterior_is_two_files(service: Client, tmp_path: Path) -> None:
    """Fetching writes result.json and report.html, and no part of a posterior.nc."""
    run = service.upload(run_text(908))
    fit = service.fit([run], options={"posterior": False})

    files = service.fetch(service.wait(fit), tmp_path / "m")

    assert sorted(files) == ["report", "result"]
    assert sorted(tmp_path.glob("m/*")) == sorted(files.values())


def test_cancelling_twice_removes_nothing(service: Client) -> None:
    """A cancelled fit remains until it is deleted; deleting twice is no error."""
    run = service.upload(run_text(909))
    fit = service.fit([run], options={"seed": SLOW})

    assert service.cancel(fit).status == "cancelled"
    assert service.cancel(fit).status == "cancelled"
    service.delete_fit(fit)
    service.delete_fit(fit)
    with pytest.raises(NotFound):
        service.show_fit(fit)
    service.delete_run(run)
    service.delete_run(run)


def test_cancel_whose_response_is_lost_leaves_the_fit(bad: Bad, service: Client, key: str) -> None:
    """The repeated call does not remove the fit that the first one has cancelled."""
    run = service.upload(run_text(910))
    fit = service.fit([run], options={"seed": SLOW})

    bad.faults = [lost]
    with Client(bad.url, key) as client:
        assert client.cancel(fit).status == "cancelled"

    assert bad.seen == ["DELETE", "DELETE"]
    assert service.show_fit(fit).status == "cancelled"


def test_lists_continue_over_pages(service: Client, monkeypatch: pytest.MonkeyPatch) -> None:
    """With pages of two, five runs of a motor are listed once each, newest first."""
    monkeypatch.setattr(calls, "_PAGE", 2)
    made = [service.upload(run_text(920 + number), motor="paged").id for number in range(5)]

    assert [run.id for run in service.runs(motor="paged")] == made[::-1]


def test_batch_is_waited_for_and_cancelled(service: Client) -> None:
    """A batch with one failed fit ends as partial; a running batch is cancelled and deleted."""
    run = service.upload(run_text(930))
    motors: list[dict[str, object]] = [
        {"motor": "good", "training": [run]},
        {"motor": "bad", "training": [run.id], "options": {"seed": BAD_INPUT}},
    ]
    told: list[str] = []

    batch = service.wait_batch(
        service.batch(motors, name="two"), progress=lambda words, share: told.append(words)
    )
    slow = service.batch([{"training": [run]}], options={"seed": SLOW})

    assert (batch.status, batch.fraction, batch.name) == ("partial", 1.0, "two")
    assert [fit["status"] for fit in batch.fits] == ["succeeded", "failed"]
    assert told[-1] == "2 of 2 motors"
    assert service.cancel_batch(slow).status == "cancelled"
    assert {one.id for one in service.batches()} >= {batch.id, slow.id}
    service.delete_batch(slow)
    with pytest.raises(NotFound):
        service.show_batch(slow)


def test_key_is_not_shown(server: Server, key: str) -> None:
    """The representation of a client does not contain the key."""
    with Client(server.url, key) as client:
        assert key not in repr(client) + repr(vars(client))


def test_callers_of_the_service_tests_are_clients(alice: Caller) -> None:
    """The other contract tests upload and fit through the client, and thereby test it."""
    assert isinstance(alice.client, Client)
