"""Container as an engine creates it: namespaces, read-only root, user without capabilities.

Its network has a loopback device only; callers enter that network.
"""

from __future__ import annotations

import ctypes
import os
import signal
import subprocess
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from benchmarks.container.image import Image

__all__ = ["ADDRESS", "Box"]

ADDRESS = "192.0.2.1"
"""Address of the container in addition to loopback (RFC 5737), as in a network."""

_NEW_NETWORK = 0x40000000
_SCRIPT = f"""
set -eu
image=$1 volume=$2 name=$3 new=$4
shift 4
mount --bind "$image" "$new"
mount -o remount,bind,ro,nosuid,nodev "$new"
mount --bind -o nosuid,nodev "$volume" "$new/data"
mount -t proc -o nosuid,nodev,noexec proc "$new/proc"
mount -t tmpfs -o mode=755,nosuid,noexec tmpfs "$new/dev"
for device in "null c 1 3" "zero c 1 5" "random c 1 8" "urandom c 1 9"; do
    mknod -m 666 "$new/dev/"$device
done
ln -s /proc/self/fd "$new/dev/fd"
mkdir -m 1777 "$new/dev/shm"
mount -t tmpfs -o size=64m,mode=1777,nosuid,nodev,noexec tmpfs "$new/dev/shm"
ip link set lo up
ip address add {ADDRESS}/32 dev lo
hostname "$name"
exec chroot "$new" "$@"
"""


class Box:
    """A container that runs until it is stopped or killed.

    Args:
        image: Image of the container.
        volume: Directory that becomes /data.
        work: Directory for mount point and log.
        name: Host name.
        variables: Variables in addition to those of the image.
    """

    def __init__(
        self, image: Image, volume: Path, work: Path, name: str, variables: Mapping[str, str]
    ) -> None:
        self._image = image
        self._variables = {**image.variables, "HOSTNAME": name, **variables}
        new = work / f"{name}-root"
        new.mkdir(exist_ok=True)
        self.log = work / f"{name}.log"
        isolated = ("--mount", "--propagation", "private", "--pid", "--net", "--ipc", "--uts")
        with self.log.open("a", encoding="utf-8") as log:
            self.process = subprocess.Popen(
                [
                    *("unshare", *isolated, "--fork", "--kill-child", "sh", "-c", _SCRIPT, "box"),
                    *(str(image.root), str(volume), name, str(new)),
                    *self._as_user(image.command),
                ],
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
            )
        self.began = time.monotonic()
        self.first = self._await_first()

    def _as_user(self, words: list[str]) -> list[str]:
        user, group = self._image.user
        none = ("--bounding-set=-all", "--inh-caps=-all", "--ambient-caps=-all", "--no-new-privs")
        settings = [f"{name}={value}" for name, value in self._variables.items()]
        limited = ["setpriv", f"--reuid={user}", f"--regid={group}", "--clear-groups", *none]
        place = f"--chdir={self._image.config['WorkingDir']}"
        return ["/usr/bin/env", "--ignore-environment", place, *settings, *limited, "--", *words]

    def _await_first(self) -> int:
        """Host process id of process 1 of the container, once it is in its own root."""
        children = Path(f"/proc/{self.process.pid}/task/{self.process.pid}/children")
        while self.process.poll() is None and time.monotonic() - self.began < 30:
            if (listed := children.read_text().split()) and _root(listed[0]) != "/":
                return int(listed[0])
            time.sleep(0.01)
        self.process.kill()
        raise AssertionError(f"it does not start:\n{self.log.read_text()}")

    def processes(self) -> list[int]:
        """Host process ids of all processes in the container."""
        space = os.readlink(f"/proc/{self.first}/ns/pid")
        found = []
        for entry in Path("/proc").iterdir():
            try:
                if entry.name.isdigit() and os.readlink(entry / "ns" / "pid") == space:
                    found.append(int(entry.name))
            except OSError:
                continue
        return found

    def execute(self, *words: str) -> subprocess.CompletedProcess[str]:
        """Run a command in the container as its user, as `docker exec` does."""
        entered = ("--target", str(self.first), "--mount", "--pid", "--net", "--ipc", "--uts")
        return subprocess.run(
            ["nsenter", *entered, "--root", *self._as_user(list(words))],
            capture_output=True,
            text=True,
            timeout=120,
        )

    def is_healthy(self) -> bool:
        """Return True if the health check of the image succeeds."""
        return self.execute(*self._image.config["Healthcheck"]["Test"][1:]).returncode == 0

    def await_health(self, limit_s: float = 120.0) -> float:
        """Wait until the container is healthy; return the time since its start [s]."""
        while self.process.poll() is None and time.monotonic() - self.began < limit_s:
            if self.is_healthy():
                return time.monotonic() - self.began
            time.sleep(0.1)
        raise AssertionError(f"it does not become healthy:\n{self.log.read_text()}")

    @contextmanager
    def network(self) -> Iterator[None]:
        """Let this thread connect within the network of the container."""
        library = ctypes.CDLL(None, use_errno=True)
        with open("/proc/thread-self/ns/net") as own, open(f"/proc/{self.first}/ns/net") as other:
            _enter(library, other.fileno())
            try:
                yield
            finally:
                _enter(library, own.fileno())

    def stop(self, grace_s: float = 10.0) -> tuple[float, int]:
        """Stop the container as `docker stop` does; return the duration [s] and its exit status."""
        began = time.monotonic()
        os.kill(self.first, signal.SIGTERM)
        try:
            status = self.process.wait(timeout=grace_s)
        except subprocess.TimeoutExpired:
            status = self.kill()
        return time.monotonic() - began, status

    def kill(self) -> int:
        """Kill process 1 of the container, as a power failure would."""
        if self.process.poll() is None:
            os.kill(self.first, signal.SIGKILL)
        return self.process.wait(timeout=60)


def _root(process: str) -> str:
    """Root directory of a process; "/" if the process has ended."""
    try:
        return os.readlink(f"/proc/{process}/root")
    except FileNotFoundError:
        return "/"


def _enter(library: ctypes.CDLL, handle: int) -> None:
    if library.setns(handle, _NEW_NETWORK) != 0:
        number = ctypes.get_errno()
        raise OSError(number, os.strerror(number))
