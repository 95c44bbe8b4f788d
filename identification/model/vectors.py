"""Vectorised exp, log, sin, cos and pow, from the C library where available.

LLVM can only call the scalar functions, one lane at a time.  The C library of Linux has versions
for AVX2 and AVX-512 registers (libmvec, error at most 4 units in the last place).  These functions
dominate the run time of a motor with smooth friction or a brush drop.  Without the library each
lane is computed separately.

Source: GNU C Library, "Vector ABI of x86-64" and the notes to version 2.22 (exp, log, pow, sin,
cos).
"""

from __future__ import annotations

import functools
from typing import Final

import llvmlite.binding as llvm

__all__ = ["vector_functions", "vector_width"]

_LIBRARY: Final = "libmvec.so.1"
_NAMES: Final = {"exp": "v", "log": "v", "sin": "v", "cos": "v", "pow": "vv"}
"""Functions and the letters of their operands in the names of their versions."""


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
