"""Substitute for the base image without a registry: Debian and a Python of this machine.

It contains the packages that build and service use, in the same paths as the real base.
"""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

__all__ = ["make"]

_PACKAGES = "ca-certificates,netbase,tzdata"
_AUTHORITIES = Path("etc/ssl/certs/ca-certificates.crt")


def make(prefix: Path, root: Path) -> None:
    """Make the directory of a base image.

    Args:
        prefix: Prefix of a Python with `bin` and `lib`, not that of the system.
        root: Directory to make.
    """
    release = _release()
    packages = ",".join([_PACKAGES, *_libraries(prefix)])
    _run("debootstrap", "--variant=minbase", f"--include={packages}", release, str(root))
    for part in ("bin", "lib"):
        shutil.copytree(
            prefix / part,
            root / "usr" / "local" / part,
            symlinks=True,
            dirs_exist_ok=True,
            ignore=shutil.ignore_patterns("site-packages", "__pycache__", "test", "*.a"),
        )
    # A proxy between this machine and the package index must be trusted in the image too.
    shutil.copy(Path("/") / _AUTHORITIES, root / _AUTHORITIES)
    inside = ("chroot", str(root))
    _run(*inside, "ldconfig")
    _run(*inside, "/usr/local/bin/python3", "-m", "ensurepip")
    for name in ("python", "pip"):
        link = root / "usr" / "local" / "bin" / name
        link.unlink(missing_ok=True)
        link.symlink_to(f"{name}3")


def _release() -> str:
    text = Path("/etc/os-release").read_text(encoding="utf-8")
    values = dict(line.split("=", 1) for line in text.splitlines() if "=" in line)
    return values["VERSION_CODENAME"].strip('"')


def _libraries(prefix: Path) -> list[str]:
    """Packages of this machine that provide the libraries of the interpreter."""
    modules = [p for p in prefix.glob("lib/python3*/lib-dynload/*.so") if "tkinter" not in p.name]
    listed = _run("ldd", *map(str, [prefix / "bin" / "python3", *modules]))
    found = {line.split()[2] for line in listed.splitlines() if "=> /" in line}
    files = {Path(path).resolve() for path in found if not path.startswith(str(prefix))}
    # A package may list its file below /lib or /usr/lib, which are the same directory.
    system = {f"*/{file.parent.name}/{file.name}" for file in files}
    owners = _run("dpkg", "--search", *sorted(system))
    return sorted({line.split(":")[0] for line in owners.splitlines()})


def _run(*words: str) -> str:
    return subprocess.run(words, check=True, stdout=subprocess.PIPE, text=True).stdout
