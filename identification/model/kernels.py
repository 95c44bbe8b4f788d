"""Machine code of compiled loops, kept on disk from one process to the next.

Half of what a fit of a short record costs is compiling, and the same structures are compiled for
every motor.  A file holds the object code of one loop under a name that says everything it depends
on: the step function, the effort, the sources of the compiler here, llvmlite and the processor.

What is read is run, so that only files of this user in a folder that nobody else can write count,
and each begins with its own checksum: a file cut short by a power failure is compiled anew.  Where
there is no such folder, nothing is kept.  `MOTORID_CACHE` names another folder; empty, none.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import os
import stat
import tempfile
from pathlib import Path
from typing import Final

import llvmlite
import llvmlite.binding as llvm

from identification.model.vectors import vector_functions

__all__ = ["keep", "kept"]

_MOST: Final = 4_000
"""Files that are kept; of more, the half that was used longest ago is removed.  A fit uses some
200 of some 20 kB."""
_SOURCES: Final = ("kernels.py", "loop.py", "lowering.py", "scan.py", "vectors.py")
_SUM: Final = hashlib.sha256().digest_size


def kept(key: str) -> bytes | None:
    """Object code that was kept; None where there is none that is whole and this user's own.

    Args:
        key: Of the loop, letters and digits.
    """
    folder = _folder()
    if folder is None:
        return None
    path = folder / key
    try:
        with path.open("rb") as file:
            if os.fstat(file.fileno()).st_uid != os.geteuid():
                return None
            content = file.read()
        if hashlib.sha256(content[_SUM:]).digest() != content[:_SUM]:
            return None
        os.utime(path)
    except OSError:
        return None
    return content[_SUM:]


def keep(key: str, code: bytes) -> None:
    """Keep object code, whole or not at all; a disk that is full or cannot be written is no error.

    Args:
        key: Of the loop, letters and digits.
        code: Object code.
    """
    folder = _folder()
    if folder is None:
        return
    try:
        descriptor, name = tempfile.mkstemp(dir=folder, prefix=".")
        try:
            with os.fdopen(descriptor, "wb") as file:
                file.write(hashlib.sha256(code).digest() + code)
            os.replace(name, folder / key)
        except OSError:
            with contextlib.suppress(OSError):
                os.unlink(name)
    except OSError:
        return


@functools.lru_cache(maxsize=1)
def _folder() -> Path | None:
    """The folder for this compiler and processor, made where it can be; None where it cannot."""
    chosen = os.environ.get("MOTORID_CACHE")
    if chosen == "":
        return None
    try:
        home = os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache")
        root = Path(chosen) if chosen else Path(home) / "motorid"
        folder = root / _tag()
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        found = folder.stat()
        if found.st_uid != os.geteuid() or found.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
            return None
        _tidied(folder)
    except (OSError, RuntimeError):
        return None
    return folder


def _tag() -> str:
    """What machine code depends on beside its function."""
    parts = [llvmlite.__version__, llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten()]
    parts += sorted(vector_functions().values())
    found = hashlib.sha256("\0".join(parts).encode())
    for name in _SOURCES:
        found.update((Path(__file__).parent / name).read_bytes())
    return found.hexdigest()[:32]


def _tidied(folder: Path) -> None:
    """Remove the half that was used longest ago where there are too many."""
    with os.scandir(folder) as entries:
        files = [(entry.stat().st_mtime, entry.path) for entry in entries]
    if len(files) > _MOST:
        for _, path in sorted(files)[: len(files) // 2]:
            with contextlib.suppress(OSError):
                os.unlink(path)
