"""Compilation of LLVM text to machine code, its cache on disk, and its loading into this process.

Compilation takes half the time of a fit of a short record, and the same model structures are
compiled for every motor.  Each file of the cache holds the object code of one loop.  Its path
identifies all that the code depends on: step function, optimisation level, sources of the compiler
in this package, llvmlite and processor.

Cached code is executed, so a file is used only if it belongs to this user and lies in a folder
that nobody else can write to.  Each file begins with its checksum: a file truncated by a power
failure is compiled again.  Without such a folder nothing is cached.  `MOTORID_CACHE` sets another
folder; an empty value disables the cache.

LLVM can only call the scalar exp, log, sin, cos and pow, one lane at a time.  The C library of
Linux has versions for AVX2 and AVX-512 registers (libmvec, error at most 4 units in the last
place).  These functions dominate the run time of a motor with smooth friction or a brush drop.
Without the library each lane is computed separately.

Source: GNU C Library, "Vector ABI of x86-64" and the notes to version 2.22 (exp, log, pow, sin,
cos).
"""

from __future__ import annotations

import contextlib
import ctypes
import functools
import hashlib
import itertools
import os
import stat
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final, Literal

import llvmlite
import llvmlite.binding as llvm

__all__ = ["Level", "Loaded", "compiled", "keep", "kept", "vector_functions", "vector_width"]

Level = Literal[0, 2]
"""LLVM's level of code generation: 0 quick, 2 optimised."""
_MOST: Final = 4_000
"""Largest number of files in the cache; above it the least recently used half is removed.  A fit
uses about 200 files of about 20 kB each, one of a long real log up to 900."""
_SOURCES: Final = (
    "instructions.py",
    "loop.py",
    "lowering.py",
    "machine.py",
    "scan.py",
    "split_loop.py",
)
_SUM: Final = hashlib.sha256().digest_size
_LIBRARY: Final = "libmvec.so.1"
_NAMES: Final = {"exp": "v", "log": "v", "sin": "v", "cos": "v", "pow": "vv"}
"""Vectorised functions and the letters of their operands in the names of their versions."""


def compiled(text: Callable[[], str], level: Level, key: str | None) -> bytes:
    """Object code from the cache on disk, or compiled and kept there; without a key not kept.

    CasADi's list has no dead operations, and its own search removes repeated ones, so LLVM's passes
    over the text would double the compile time without faster code.
    """
    code = kept(key) if key else None
    if code is None:
        code = _compile(text(), level)
        if key:
            keep(key, code)
    return code


def _compile(text: str, level: Level) -> bytes:
    target = _target(level)
    module = llvm.parse_assembly(text)
    module.verify()
    return bytes(target.emit_object(module))


class Loaded:
    """A function ``scan`` as machine code in this process, as long as this object exists."""

    def __init__(self, code: bytes, arguments: tuple[Any, ...]) -> None:
        # Held here: of two linkers that threads make at once, the cache keeps only one.
        self._linker = _linker()
        builder = llvm.JITLibraryBuilder().add_object_img(code).add_current_process()
        self._library = builder.export_symbol("scan").link(self._linker, f"loop{next(_numbers)}")
        self.run = ctypes.CFUNCTYPE(None, *arguments)(self._library["scan"])


_numbers = itertools.count()


@functools.cache
def _target(level: Level) -> llvm.TargetMachine:
    """Code generator for this processor."""
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    return _new_target(level)


def _new_target(level: Level) -> llvm.TargetMachine:
    return llvm.Target.from_default_triple().create_target_machine(
        cpu=llvm.get_host_cpu_name(),
        features=llvm.get_host_cpu_features().flatten(),
        opt=level,
        jit=True,
    )


@functools.cache
def _linker() -> llvm.LLJIT:
    """Linker of object code into this process; it frees its own code generator."""
    _target(0)
    return llvm.create_lljit_compiler(_new_target(0))


def kept(key: str) -> bytes | None:
    """Cached object code; None if there is no intact file that belongs to this user."""
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
    """Write object code to the cache atomically; a full or read-only disk is no error."""
    folder = _folder()
    if folder is None:
        return
    with contextlib.suppress(OSError):
        descriptor, name = tempfile.mkstemp(dir=folder, prefix=".")
        try:
            with os.fdopen(descriptor, "wb") as file:
                file.write(hashlib.sha256(code).digest() + code)
            os.replace(name, folder / key)
        except OSError:
            os.unlink(name)


@functools.lru_cache(maxsize=1)
def _folder() -> Path | None:
    """Cache folder for this compiler and processor, created if needed; None if unusable."""
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
    """Hash of everything the machine code depends on, except the step function and the effort."""
    parts = [llvmlite.__version__, llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten()]
    parts += sorted(vector_functions().values())
    found = hashlib.sha256("\0".join(parts).encode())
    for name in _SOURCES:
        found.update((Path(__file__).parent / name).read_bytes())
    return found.hexdigest()[:32]


def _tidied(folder: Path) -> None:
    """Remove the least recently used half of the files if there are too many."""
    with os.scandir(folder) as entries:
        files = [(entry.stat().st_mtime, entry.path) for entry in entries]
    if len(files) > _MOST:
        for _, path in sorted(files)[: len(files) // 2]:
            with contextlib.suppress(OSError):
                os.unlink(path)


@functools.cache
def vector_width() -> int:
    """Lanes of one call: those of the widest registers of this processor."""
    return 8 if llvm.get_host_cpu_features().get("avx512f", False) else 4


@functools.cache
def vector_functions() -> dict[str, str]:
    """Symbols of the available versions for `vector_width` lanes; loads their library."""
    if not llvm.get_host_cpu_features().get("avx2", False):
        return {}
    try:
        llvm.load_library_permanently(_LIBRARY)
    except RuntimeError:
        return {}
    width = vector_width()
    registers = {4: "d", 8: "e"}[width]
    symbols = {name: f"_ZGV{registers}N{width}{word}_{name}" for name, word in _NAMES.items()}
    return {name: symbol for name, symbol in symbols.items() if llvm.address_of_symbol(symbol)}
