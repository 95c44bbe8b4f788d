"""Exponentials, logarithms and their like for four lanes at once, where the machine has them.

LLVM knows these functions only one number at a time.  The C library of Linux brings versions for
whole registers (libmvec, at most 4 units in the last place from exact), which a motor with smooth
friction or a brush drop spends most of its time in.  Where they are absent each lane is computed
by itself.

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
    """Symbol of a function for `WIDTH` lanes, or None where this machine has none.

    Args:
        name: Name of the function for one number: exp, log, sin, cos or pow.
    """
    return vector_functions().get(name)


@functools.cache
def vector_functions() -> dict[str, str]:
    """Symbols by name of what this machine has; from then on code that calls them can be loaded."""
    if not llvm.get_host_cpu_features().get("avx2", False):
        return {}
    try:
        llvm.load_library_permanently(_LIBRARY)
    except RuntimeError:
        return {}
    return {name: symbol for name, symbol in _NAMES.items() if llvm.address_of_symbol(symbol)}
