"""Compilation of LLVM text to machine code, and its loading into this process."""

from __future__ import annotations

import ctypes
import functools
import itertools
from collections.abc import Callable
from typing import Any, Literal

import llvmlite.binding as llvm

from identification.model.kernels import keep, kept

__all__ = ["Level", "Loaded", "compiled"]

Level = Literal[0, 2]
"""LLVM's level of code generation: 0 quick, 2 optimised."""


def compiled(text: Callable[[], str], level: Level, key: str | None) -> bytes:
    """Object code from the cache on disk, or compiled and kept there; without a key not kept.

    CasADi's list has no dead and few repeated operations, so LLVM's passes over the text would
    double the compile time without faster code.
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
