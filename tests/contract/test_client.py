"""`motorid.client` against a real service, and against one whose answers are lost on the way."""

from __future__ import annotations

import json
import re
import threading
import time
from collections.abc import Callable, Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import httpx
import pytest

from motorid import client as module
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
from tests.app.pretended import BAD_INPUT, SLOW
from tests.app.service import Caller, Server, make_key, run_text

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def key(server: Server) -> str:
    """A key of a workspace of the client's own."""
    return make_key(server.data_dir, "client")


@pytest.fixture(scope="module")
def service(server: Server, key: str) -> Iterator[Client]:
    """A client that is not patient with a service that is gone."""
    with Client(server.url, key, patience_s=20) as client:
        yield client


class Bad(ThreadingHTTPServer):
    """A way to the service on which the first answers to some calls are lost or replaced.

    Args:
        server: The service.
    """

    daemon_threads = True

    def __init__(self, server: Server) -> None:
        self.faults: list[Callable[[BaseHTTPRequestHandler], None]] = []
        self.seen: list[str] = []
        self.target = server.url
        super().__init__(("127.0.0.1", 0), Passing)
        self.url = f"http://127.0.0.1:{self.server_address[1]}"


class Passing(BaseHTTPRequestHandler):
    """Passes a call on, then does to its answer what is the fault of the moment."""

    def pass_on(self) -> None:
        """Any call."""
        assert isinstance(self.server, Bad)
        self.server.seen.append(self.command)
        body = self.rfile.read(int(self.headers.get("Content-Length", 0)))
        # The host that was called is checked by the service.
        headers = {n: v for n, v in self.headers.items() if n.lower() != "host"}
        answer = httpx.request(
            self.command, self.server.target + self.path, content=body, headers=headers
        )
        fault = self.server.faults.pop(0) if self.server.faults else whole
        if fault is not whole:
            fault(self)
            return
        self.send_response(answer.status_code)
        self.send_header("Content-Type", answer.headers.get("content-type", ""))
        self.send_header("Content-Length", str(len(answer.content)))
        self.end_headers()
        self.wfile.write(answer.content)

    do_GET = do_POST = do_DELETE = pass_on  # noqa: N815  the names that the base class calls

    def log_message(self, format: str, *args: object) -> None:  # noqa: A002  the base class's name
        """Say nothing."""


def whole(handler: BaseHTTPRequestHandler) -> None:
    """No fault."""


def lost(handler: BaseHTTPRequestHandler) -> None:
    """The connection ends before the answer."""
    handler.close_connection = True


def not_now(seconds: str) -> Callable[[BaseHTTPRequestHandler], None]:
    """An answer that asks to come again."""

    def answer(handler: BaseHTTPRequestHandler) -> None:
        handler.send_response(503)
        handler.send_header("Retry-After", seconds)
        handler.send_header("Content-Length", "0")
        handler.end_headers()

    return answer


@pytest.fixture
def bad(server: Server) -> Iterator[Bad]:
    """A bad way to the service."""
    way = Bad(server)
    thread = threading.Thread(target=way.serve_forever, args=(0.02,), daemon=True)
    thread.start()
    yield way
    way.shutdown()
    thread.join()
    way.server_close()


@pytest.mark.parametrize("page", ["README.md", "docs/client.md", "motorid/client.py"])
def test_upload_wait_and_fetch_are_the_five_lines_that_are_shown(
    page: str, server: Server, key: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The lines as they stand on the page, with this server's address and key."""
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
    """Uploads are known again by content; the name is that of the file, or as given."""
    path = tmp_path / "bench 7.csv"
    path.write_bytes(run_text(901))

    first = service.upload(path, motor="m 1")
    again = service.upload(path.read_bytes(), name="other.csv")

    assert (first.file, first.motor, first.rows) == ("bench 7.csv", "m 1", 60)
    assert again.id == first.id
    assert service.show_run(first) == first


def test_mapping_goes_with_the_run(service: Client) -> None:
    """Speed in rpm under another name: the service reads it by the mapping."""
    text = run_text(902).replace(b"speed_rad_s", b"n_ist")
    mapping = {"speed_rad_s": {"column": "n_ist", "unit": "rpm"}}

    with pytest.raises(Refused, match="n_ist|speed"):
        service.upload(text)

    assert service.upload(text, mapping=mapping).rows == 60


def test_errors_carry_what_the_service_said(service: Client, server: Server) -> None:
    """File, row, column and code of RFC 9457 problems; classes by status."""
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
def test_fit_whose_answer_was_lost_is_not_made_twice(
    bad: Bad, service: Client, key: str, faults: list[Callable[[BaseHTTPRequestHandler], None]]
) -> None:
    """The call comes as often as answers are lost and once more; the service knows one fit more."""
    run = service.upload(run_text(904))
    motor = f"motor {time.monotonic_ns()}"
    bad.faults = list(faults)

    with Client(bad.url, key) as client:
        fit = client.fit([run], motor=motor)

    assert bad.seen == ["POST"] * (len(faults) + 1)
    assert [one.id for one in service.fits(motor=motor)] == [fit.id]


def test_upload_is_sent_from_its_beginning_again(
    bad: Bad, service: Client, key: str, tmp_path: Path
) -> None:
    """A file that was read to its end in the first try is complete in the second."""
    path = tmp_path / "run.csv"
    path.write_bytes(run_text(905))
    bad.faults = [lost]

    with Client(bad.url, key) as client:
        assert client.upload(path).id == service.upload(path).id


def test_retry_after_is_obeyed(bad: Bad, key: str) -> None:
    """A service that says 1 is not asked again before a second is over."""
    bad.faults = [not_now("1")]
    began = time.monotonic()

    with Client(bad.url, key) as client:
        list(client.batches())

    assert time.monotonic() - began >= 1.0
    assert len(bad.seen) == 2


def test_retry_after_may_be_a_date() -> None:
    """RFC 9110, 10.2.3: seconds or a date; one that has passed means at once."""

    def asked(value: str) -> float:
        return pause_s(1, httpx.Response(503, headers={"Retry-After": value}))

    assert asked("7") == 7.0
    assert asked("Wed, 21 Oct 2015 07:28:00 GMT") == 0.0
    assert asked("Wed, 21 Oct 2150 07:28:00 GMT") > 1e9
    assert asked("soon") <= 0.2


def test_pauses_double_up_to_a_limit() -> None:
    """Half to all of 0.2, 0.4, 0.8 ... s, and never more than 8 s."""
    for tried, longest in ((1, 0.2), (2, 0.4), (3, 0.8), (6, 6.4), (7, 8.0), (60, 8.0)):
        pauses = [pause_s(tried) for _ in range(50)]
        assert longest / 2 <= min(pauses) <= max(pauses) <= longest


def test_patience_ends(bad: Bad, key: str) -> None:
    """Who is asked to wait longer than the patience gets the error, and so who gets no answer."""
    bad.faults = [not_now("3600")]
    with Client(bad.url, key, patience_s=1) as client, pytest.raises(Busy):
        client.show_batch("x")

    with (
        Client("http://127.0.0.1:9", patience_s=0.5) as client,
        pytest.raises(Unreachable, match=r"127\.0\.0\.1:9 does not answer"),
    ):
        client.show_batch("x")


def test_waiting_tells_progress_and_gives_up_in_time(service: Client) -> None:
    """A fit of 2 s: the share never falls, and 0.3 s are too short."""
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


def test_fit_that_failed_says_why(service: Client, tmp_path: Path) -> None:
    """The pretended pipeline names file, row and column."""
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
    """No posterior.nc, and no rest of one."""
    run = service.upload(run_text(908))
    fit = service.fit([run], options={"posterior": False})

    files = service.fetch(service.wait(fit), tmp_path / "m")

    assert sorted(files) == ["report", "result"]
    assert sorted(tmp_path.glob("m/*")) == sorted(files.values())


def test_cancelling_twice_removes_nothing(service: Client) -> None:
    """A cancelled fit stays to be seen; deleting it twice is no error."""
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


def test_cancel_whose_answer_is_lost_leaves_the_fit(bad: Bad, service: Client, key: str) -> None:
    """The next look tells that it was cancelled, so it is not sent again."""
    run = service.upload(run_text(910))
    fit = service.fit([run], options={"seed": SLOW})

    bad.faults = [whole, lost]
    with Client(bad.url, key) as client:
        assert client.cancel(fit).status == "cancelled"

    assert bad.seen == ["GET", "DELETE", "GET"]
    assert service.show_fit(fit).status == "cancelled"


def test_lists_go_on_over_pages(service: Client, monkeypatch: pytest.MonkeyPatch) -> None:
    """Pages of two: five runs of one motor come once each, newest first."""
    monkeypatch.setattr(module, "_PAGE", 2)
    made = [service.upload(run_text(920 + number), motor="paged").id for number in range(5)]

    assert [run.id for run in service.runs(motor="paged")] == made[::-1]


def test_batch_is_waited_for_and_cancelled(service: Client) -> None:
    """Two motors, one of which fails: partial; a slow one: cancelled, then removed."""
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
    """A client that is printed in a log shows no key."""
    with Client(server.url, key) as client:
        assert key not in repr(client) + repr(vars(client))


def test_callers_of_the_service_tests_are_clients(alice: Caller) -> None:
    """Uploads and fits of the other tests go through the client, so that they test it, too."""
    assert isinstance(alice.client, Client)
