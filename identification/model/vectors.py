"""Vectorised exp, log, sin, cos and pow for four lanes, from the C library where available.

LLVM can only call the scalar functions, one lane at a time.  The C library of Linux has versions
for AVX2 registers (libmvec, error at most 4 units in the last place).  These functions dominate
the run time of a motor with smooth friction or a brush drop.  Without the library each lane is
computed separately.

Source: GNU C Library, "Vector ABI of x86-64" and the notes to version 2.22 (exp, log, pow, sin,
cos).
"""

from __future__ import annotations

import functools
from typing import Final

import llvmlite.binding as llvm

__all__ = ["WIDTH", "vector_function", "vector_functions"]

WIDTH: Final = 4
"""Lanes of one call."""

_LIBRARY: Final = "libmvec.so.1"
_NAMES: Final = {
    "exp": "_ZGVdN4v_exp",
    "log": "_ZGVdN4v_log",
    "sin": "_ZGVdN4v_sin",
    "cos": "_ZGVdN4v_cos",
    "pow": "_ZGVdN4vv_pow",
}


def vector_function(name: str) -> str | None:
    """Symbol of the version of a function for `WIDTH` lanes, or None if this machine has none.

    Args:
        name: Name of the scalar function: exp, log, sin, cos or pow.
    """
    return vector_functions().get(name)


@functools.cache
def vector_functions() -> dict[str, str]:
    """Available vector functions, name to symbol; loads their library into the process."""
    if not llvm.get_host_cpu_features().get("avx2", False):
        return {}
    try:
        llvm.load_library_permanently(_LIBRARY)
    except RuntimeError:
        return {}
    return {name: symbol for name, symbol in _NAMES.items() if llvm.address_of_symbol(symbol)}
