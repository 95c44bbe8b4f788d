"""`motorid batch --server`: fit and resume a manifest on a service."""

from __future__ import annotations

import csv
import json
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from app.cli import main
from motorid.client import Client, Run
from tests.app.pretended import BAD_INPUT, QUICK, SLOW
from tests.app.service import Caller, Server, make_key, run_text, serving


@pytest.fixture
def caller(server: Server) -> Iterator[Caller]:
    """Client of a workspace that no other test uses."""
    with Caller(server, make_key(server.data_dir, f"w{time.monotonic_ns()}")) as made:
        yield made


def manifest(directory: Path, **seeds: int) -> Path:
    """Manifest of motors with given seeds and two runs each."""
    directory.mkdir(exist_ok=True)
    lines = ["motor,training,validation,seed,posterior"]
    for number, (name, seed) in enumerate(seeds.items()):
        for run in range(2):
            content = run_text(1000 + 10 * number + run)
            (directory / f"{name}_{run}.csv").write_bytes(content)
        lines.append(f"{name},{name}_0.csv,{name}_1.csv,{seed},no")
    path = directory / "fleet.csv"
    path.write_text("\n".join([*lines, ""]))
    return path


def batch(path: Path, out: Path, caller: Caller) -> int:
    """Run the command with the service and key of a client."""
    key = caller.http.headers["authorization"].removeprefix("Bearer ")
    words = ["batch", str(path), "--out", str(out), "--server", caller.client.url, "--key", key]
    return main([*words, "-q"])


def rows(out: Path) -> dict[str, dict[str, str]]:
    """Rows of results.csv by motor."""
    with (out / "results.csv").open(encoding="utf-8", newline="") as file:
        return {row["motor"]: row for row in csv.DictReader(file)}


def test_service_fits_the_motors_of_the_manifest(
    caller: Caller, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """One batch, named after the manifest, gives the files of a local batch; one motor fails."""
    path = manifest(tmp_path / "bench", one=QUICK, bad=BAD_INPUT, two=QUICK)
    out = tmp_path / "out"

    status = batch(path, out, caller)

    (made,) = caller.client.batches()
    table = rows(out)
    assert (status, made.name, made.status) == (1, "fleet.csv", "partial")
    assert [row["status"] for row in table.values()] == ["fitted", "failed", "fitted"]
    assert "bad_0.csv, row 7, column speed_rad_s: the speed never moves" in table["bad"]["error"]
    assert "1 of 3 motors failed (bad)" in capsys.readouterr().err
    for name in ("one", "two"):
        assert {file.name for file in (out / name).iterdir()} == {
            "batch.json", "report.html", "result.json"
        }  # fmt: skip
        result = json.loads((out / name / "result.json").read_text())
        assert [run["role"] for run in result["runs"]] == ["training", "validation"]
        assert float(table[name]["Ra25"]) == result["parameters"]["Ra25"]["median"]
    assert (out / "fleet.html").exists()
    assert not (out / "service.json").exists()


def test_results_that_are_up_to_date_are_kept(caller: Caller, tmp_path: Path) -> None:
    """A second command submits no batch; after a changed run, only its motor is fitted again."""
    path = manifest(tmp_path / "bench", one=QUICK, two=QUICK)
    out = tmp_path / "out"

    assert batch(path, out, caller) == 0
    assert batch(path, out, caller) == 0
    assert [row["status"] for row in rows(out).values()] == ["kept", "kept"]
    assert len(list(caller.client.batches())) == 1

    (path.parent / "two_0.csv").write_bytes(run_text(1100))
    assert batch(path, out, caller) == 0
    table = rows(out)
    assert [row["status"] for row in table.values()] == ["kept", "fitted"]
    assert float(table["two"]["Ra25_drift"]) != 0.0
    assert table["two"]["previous_fit"].startswith("two/history/")
    newest, _ = caller.client.batches()
    assert [fit["motor"] for fit in caller.client.show_batch(newest).fits] == ["two"]


def test_batch_submitted_before_a_kill_is_resumed(caller: Caller, tmp_path: Path) -> None:
    """The state file of a killed command leads to the same batch, not to another."""
    path = manifest(tmp_path / "bench", one=QUICK, two=SLOW)
    out = tmp_path / "out"

    class Killed(BaseException):
        """Interruption of the command, as by a signal."""

    asked = caller.client.show_batch

    def killed(*_: object) -> None:
        raise Killed

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("motorid.client.Client.show_batch", killed)
        assert batch(path, out, caller) != 0
    state = json.loads((out / "service.json").read_text())
    (begun,) = caller.client.batches()

    assert batch(path, out, caller) == 0
    assert [made.id for made in caller.client.batches()] == [begun.id]
    assert sorted(state["records"]) == ["one", "two"]
    assert asked(begun).status == "succeeded"


def test_too_many_runs_are_split_into_several_batches(
    caller: Caller, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Three motors of two runs each, at most five runs per batch, give two batches."""
    monkeypatch.setattr("app.commands.batch.remote.MOST_RUNS", 5)
    path = manifest(tmp_path / "bench", one=QUICK, two=QUICK, three=QUICK)

    assert batch(path, tmp_path / "out", caller) == 0
    made = [caller.client.show_batch(one) for one in caller.client.batches()]
    assert [[fit["motor"] for fit in one.fits] for one in made] == [["three"], ["one", "two"]]


def test_motor_with_a_run_twice_does_not_stop_the_others(caller: Caller, tmp_path: Path) -> None:
    """A motor with two files of equal bytes fails before it is submitted."""
    path = manifest(tmp_path / "bench", one=QUICK, twice=QUICK)
    (path.parent / "twice_1.csv").write_bytes((path.parent / "twice_0.csv").read_bytes())

    assert batch(path, tmp_path / "out", caller) == 1

    table = rows(tmp_path / "out")
    assert [row["status"] for row in table.values()] == ["fitted", "failed"]
    assert "twice_1.csv: has the same content as " in table["twice"]["error"]
    assert "expected each run once, in one role" in table["twice"]["error"]


def test_quota_of_waiting_fits_splits_a_batch(
    data_dir: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With at most two waiting fits, five motors are fitted, and each run is uploaded once."""
    uploads: list[str] = []
    upload = Client.upload

    def counted(client: Client, source: Path, **words: Any) -> Run:
        uploads.append(source.name)
        return upload(client, source, **words)

    monkeypatch.setattr(Client, "upload", counted)
    seeds = dict.fromkeys(("one", "two", "three", "four", "five"), QUICK)
    path = manifest(tmp_path / "bench", **seeds)
    key = make_key(data_dir)
    with serving(data_dir, QUOTA_WAITING_FITS=2) as server, Caller(server, key) as caller:
        assert batch(path, tmp_path / "out", caller) == 0
        made = [caller.client.show_batch(one) for one in caller.client.batches()]
        motors = [{"motor": "m", "training": ["run_" + "a" * 26]}] * 3
        refused = caller.http.post("/batches", json={"motors": motors})

    assert [len(one.fits) for one in made] == [1, 2, 2]
    assert len(uploads) == len(set(uploads)) == 10
    assert {row["status"] for row in rows(tmp_path / "out").values()} == {"fitted"}
    assert (refused.status_code, refused.json()["code"]) == (403, "quota_batch")
    assert "MOTORID_QUOTA_WAITING_FITS" in refused.json()["detail"]


def test_first_local_result_is_compared_with_the_service(caller: Caller, tmp_path: Path) -> None:
    """In an empty directory the previous fit of the motor comes from the workspace."""
    path = manifest(tmp_path / "bench", one=QUICK)
    run = caller.client.upload(run_text(1200))
    before = caller.client.wait(caller.client.fit([run], motor="one"))
    assert before.result is not None

    assert batch(path, tmp_path / "out", caller) == 0

    row = rows(tmp_path / "out")["one"]
    expected = float(row["Ra25"]) - before.result["parameters"]["Ra25"]["median"]
    assert float(row["Ra25_drift"]) == expected


def test_wrong_key_and_absent_service_are_one_line(
    server: Server, tmp_path: Path, capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    """A wrong key and a wrong URL exit with status 2, an unreachable service with status 1."""
    path = manifest(tmp_path / "bench", one=QUICK)
    words = ["batch", str(path), "--out", str(tmp_path / "out")]
    monkeypatch.setenv("MOTORID_KEY", "motorid_wrong")

    assert main([*words, "--server", server.url]) == 2
    assert "motorid: --key: " in capsys.readouterr().err
    monkeypatch.setattr("app.commands.batch.command._FIRST_PATIENCE_S", 0.5)
    assert main([*words, "--server", "http://127.0.0.1:9"]) == 1
    assert "127.0.0.1:9 does not answer" in capsys.readouterr().err
    assert main([*words, "--server", "localhost:8000"]) == 2
    assert "'localhost:8000' is no address of a service" in capsys.readouterr().err
    assert main([*words, "--server", f"{server.url}/nowhere"]) == 2
