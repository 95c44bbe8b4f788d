"""Tests of the container: restrictions, health, shutdown time and persistence."""

from __future__ import annotations

import os
import re
import signal
import socket
import time
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from benchmarks.container.box import ADDRESS, Box
from benchmarks.container.image import Image
from benchmarks.torture.outcome import Outcome
from motorid.client import Client, FitState, Run

__all__ = ["run"]

_RUNS = Path(__file__).parents[2] / "data" / "clean_servo"
_SECRET = re.compile(r"(^|/)(\.env|\.git|\.netrc|\.pypirc|id_rsa|secrets?)(/|$)|\.(key|pfx|p12)$")
_SECRET_VARIABLE = re.compile("PASSWORD|TOKEN|SECRET|KEY|INDEX_URL", re.IGNORECASE)


def run(image: Image, work: Path) -> Iterator[Outcome]:
    """Start, use, stop and kill the container.

    Args:
        image: The image.
        work: An empty directory.
    """
    yield _content(image)
    volume = work / "volume"
    volume.mkdir(mode=0o700)
    os.chown(volume, *map(int, image.user))
    with _running(image, volume, work, "bench") as box:
        ready = box.await_health()
        yield Outcome("start", "healthy within 60 s", f"{ready:.1f} s", ready < 60)
        yield from _locked_down(box)
        yield _at_rest(box)
        yield _reaped(box)
        key = box.execute("motorid", "keys", "create", "bench-1").stdout.strip()
        with box.network(), Client(f"http://{ADDRESS}:8000", key) as client:
            yield _helped()
            yield _reported(client, work / "first")
            fit = _begun(client)
            with _half_an_upload(key):
                took, status = box.stop()
    said = '"message": "stopped"' in box.log.read_text()
    words = f"{took:.1f} s, status {status}{', logged' if said else ''}"
    yield Outcome(
        "SIGTERM during a fit and an upload",
        "status 0 within the 10 s of docker stop, and a log entry",
        words,
        status == 0 and took < 10 and said,
    )
    yield from _kept(image, volume, work, key, fit)
    yield _settings(image, volume, work)


@contextmanager
def _running(image: Image, volume: Path, work: Path, name: str, **variables: str) -> Iterator[Box]:
    box = Box(image, volume, work, name, variables)
    try:
        yield box
    finally:
        box.kill()


def _content(image: Image) -> Outcome:
    """Search the image for secrets and sources, in file names and variables."""
    names = (str(p.relative_to(image.root)) for p in (image.root / "opt").rglob("*"))
    # The tests of a package may contain a key that protects nothing.
    found = [name for name in names if _SECRET.search(name) and "/test" not in name]
    found += [name for name in image.variables if _SECRET_VARIABLE.search(name)]
    found += [str(path) for path in image.root.glob("build*")]
    base = 0 if image.base is None else sum(_bytes(p) for p in image.base.rglob("*"))
    words = f"{image.size / 1e6:.0f} MB, {base / 1e6:.0f} MB of it the stand-in for the base"
    words += f"; built in {image.build_s:.0f} s; {found or 'no secret'}"
    return Outcome("image", "no secret in it", words, not found)


def _bytes(path: Path) -> int:
    return path.stat().st_size if path.is_file() and not path.is_symlink() else 0


def _locked_down(box: Box) -> Iterator[Outcome]:
    status = dict(
        line.split(":\t", 1)
        for line in Path(f"/proc/{box.first}/status").read_text().splitlines()
        if ":\t" in line
    )
    capabilities = {value for name, value in status.items() if name.startswith("Cap")}
    words = f"user {status['Uid'].split()[0]}, capabilities {', '.join(capabilities)}"
    is_bare = capabilities == {"0" * 16} and status["NoNewPrivs"].strip() == "1"
    yield Outcome(
        "privileges",
        "no root, no capabilities",
        words,
        is_bare and not status["Uid"].startswith("0"),
    )
    tried = {place: box.execute("touch", f"{place}/probe") for place in ("/", "/opt", "/tmp")}  # noqa: S108
    refused = [place for place, done in tried.items() if "Read-only" in done.stderr]
    yield Outcome("write", "refused", f"read-only: {', '.join(refused)}", len(refused) == 3)
    with box.network():
        devices = ", ".join(name for _, name in socket.if_nameindex())
    yield Outcome("network", "loopback only", devices, devices == "lo")


def _at_rest(box: Box) -> Outcome:
    """Proportional set size of all processes of the container."""
    total = 0
    for process in box.processes():
        text = Path(f"/proc/{process}/smaps_rollup").read_text()
        total += next(int(line.split()[1]) for line in text.splitlines() if line[:4] == "Pss:")
    count = len(box.processes())
    words = f"{total / 1e3:.0f} MB, {count} processes"
    return Outcome("memory at rest", "less than 1 GB", words, total < 1e6)


def _reaped(box: Box) -> Outcome:
    """Test that PID 1 reaps orphans, which a killed fork server would leave."""
    box.execute("sh", "-c", "(sleep 0.2 & sleep 0.2 &) ; exit 0")
    time.sleep(1.0)
    states = [Path(f"/proc/{p}/stat").read_text().rsplit(")", 1)[1][1] for p in box.processes()]
    words = f"{states.count('Z')} zombies of {len(states)} processes"
    return Outcome("orphans", "reaped by PID 1", words, "Z" not in states)


def _helped() -> Outcome:
    """Fetch the page of the documentation to which the pages link."""
    with urllib.request.urlopen(f"http://{ADDRESS}:8000/help/troubleshooting.html") as answer:
        text = answer.read().decode()
    words = f"{answer.status}, {len(text) / 1e3:.0f} kB"
    return Outcome("documentation", "served without a key", words, 'id="unknown_unit"' in text)


def _reported(client: Client, out: Path) -> Outcome:
    began = time.monotonic()
    fit = client.wait(client.fit(_uploaded(client), options={"effects": False}), timeout_s=900)
    paths = client.fetch(fit, out)
    words = (
        f"{', '.join(sorted(p.name for p in paths.values()))} in {time.monotonic() - began:.0f} s"
    )
    return Outcome("upload to report by the client", "three files", words, len(paths) == 3)


def _uploaded(client: Client) -> list[Run]:
    return [client.upload(path) for path in sorted(_RUNS.glob("training_*.csv"))]


def _begun(client: Client) -> FitState:
    """Start a fit that takes longer than the limit of a stop, and wait for its first stage."""
    fit = client.fit(_uploaded(client))
    deadline = time.monotonic() + 600
    while client.show_fit(fit).status == "queued" and time.monotonic() < deadline:
        time.sleep(0.05)
    return fit


@contextmanager
def _half_an_upload(key: str) -> Iterator[None]:
    """Open an upload that announces more data than it sends."""
    with socket.create_connection((ADDRESS, 8000), timeout=10) as connection:
        head = f"POST /api/v1/runs HTTP/1.1\r\nHost: bench\r\nAuthorization: Bearer {key}\r\n"
        kind = "Content-Type: multipart/form-data; boundary=x\r\nContent-Length: 100000\r\n\r\n"
        connection.sendall((head + kind + "--x\r\n").encode())
        time.sleep(0.3)
        yield


def _kept(image: Image, volume: Path, work: Path, key: str, fit: FitState) -> Iterator[Outcome]:
    """Restart on the same volume after SIGTERM, and in another container after SIGKILL."""
    results: list[str] = []
    for name, what in (("bench", "SIGTERM"), ("other", "SIGKILL")):
        with _running(image, volume, work, name) as box:
            box.await_health()
            with box.network(), Client(f"http://{ADDRESS}:8000", key) as client:
                began = time.monotonic()
                ended = client.wait(fit, timeout_s=900)
                attempt = ended.content["attempt"]
                fits = [f.id for f in client.fits(status="succeeded")]
                runs = len(list(client.runs()))
                seconds = time.monotonic() - began
                lost = [old for old in results if old not in fits]
                words = f"{ended.status} as attempt {attempt} after {seconds:.0f} s"
                words += f"; {runs} runs, {len(fits)} results"
                is_kept = runs == 5 and not lost and attempt == 2
                yield Outcome(
                    f"restart after {what}", "fit continues, all data kept", words, is_kept
                )
                results = fits
                fit = _begun(client)
            os.kill(box.first, signal.SIGKILL)
            box.process.wait(timeout=60)
    strangers = [
        str(path.relative_to(volume))
        for path in volume.rglob("*")
        if path.stat().st_mode & 0o077 or path.stat().st_uid != int(image.user[0])
    ]
    words = str(strangers) if strangers else "all files and directories"
    yield Outcome("volume", "accessible to its owner only", words, not strangers)


def _settings(image: Image, volume: Path, work: Path) -> Outcome:
    """Test the health check with another port and host names, and with a halted service."""
    names = {"MOTORID_PORT": "9000", "MOTORID_ALLOWED_HOSTS": "motor.example"}
    with _running(image, volume, work, "third", **names) as box:
        box.await_health()
        with box.network():
            socket.create_connection((ADDRESS, 9000), timeout=10).close()
        before = os.times().children_user
        healthy = box.is_healthy()
        spent = os.times().children_user - before
        serving = next(p for p in box.processes() if _is_server(p))
        os.kill(serving, signal.SIGSTOP)
        told = box.execute(*image.config["Healthcheck"]["Test"][1:])
        os.kill(serving, signal.SIGCONT)
    words = f"healthy on port 9000 in {spent:.2f} s of a core; halted: {told.stderr.strip()}"
    return Outcome("settings", "health check uses them", words, healthy and told.returncode == 1)


def _is_server(process: int) -> bool:
    words = Path(f"/proc/{process}/cmdline").read_bytes().split(b"\0")
    return b"serve" in words and b"tini" not in words[0]
