"""Container image, built by buildah in a chroot, without engine and registry."""

from __future__ import annotations

import json
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks.container import standin

__all__ = ["Image", "built"]

_SOURCES = Path(__file__).parents[2]
_NAME = "motorid"
_BASE = "localhost/motorid-base"


@dataclass(frozen=True)
class Image:
    """A container image with mounted files.

    Args:
        root: Directory of the files.
        base: Directory of the substitute for the base; None for the real base.
        config: Configuration: user, variables, command, volume and health check.
        size: Size of all layers [bytes].
        build_s: Duration of the build [s].
    """

    root: Path
    base: Path | None
    config: dict[str, Any]
    size: int
    build_s: float

    @property
    def variables(self) -> dict[str, str]:
        """Environment of the image."""
        return dict(entry.split("=", 1) for entry in self.config["Env"])

    @property
    def command(self) -> list[str]:
        """Command that the image starts."""
        return [*self.config["Entrypoint"], *self.config["Cmd"]]

    @property
    def user(self) -> tuple[str, str]:
        """Numeric user and group of the processes."""
        user, group = self.config["User"].split(":")
        return user, group


@contextmanager
def built(work: Path, python: Path | None) -> Iterator[Image]:
    """Build the image and mount it.

    Args:
        work: An empty directory for the store of images and the base.
        python: Prefix of a Python that replaces the base; None uses the real base from its
        registry.
    """
    buildah = _Buildah(work)
    options = []
    base = None
    if python is not None:
        base = work / "base"
        standin.make(python, base)
        buildah.name_image(base, _BASE)
        options = ["--pull-never", "--build-arg", f"BASE={_BASE}"]
    began = time.monotonic()
    buildah.run(
        *("build", "--isolation", "chroot", "--format", "docker", "--network", "host", "--quiet"),
        *(*options, "--tag", _NAME, str(_SOURCES)),
    )
    build_s = time.monotonic() - began
    described = json.loads(buildah.run("inspect", "--type", "image", _NAME))
    container = buildah.run("from", "--pull-never", _NAME)
    root = Path(buildah.run("mount", container))
    config = described["Docker"]["config"]
    size = sum(layer["size"] for layer in json.loads(described["Manifest"])["layers"])
    try:
        yield Image(root, base, config, size, build_s)
    finally:
        buildah.run("rm", container)


class _Buildah:
    """Buildah with a separate store, which leaves other images of this machine unchanged."""

    def __init__(self, work: Path) -> None:
        self._words = ("buildah", "--root", str(work / "store"), "--runroot", str(work / "run"))

    def run(self, *words: str) -> str:
        """Run a command and return its output."""
        done = subprocess.run([*self._words, *words], check=True, stdout=subprocess.PIPE, text=True)
        return done.stdout.strip()

    def name_image(self, root: Path, name: str) -> None:
        """Make an image of a directory."""
        container = self.run("from", "scratch")
        self.run("add", "--quiet", container, str(root), "/")
        self.run("config", "--env", "PATH=/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin", container)
        self.run("commit", "--quiet", "--format", "docker", container, name)
        self.run("rm", container)
