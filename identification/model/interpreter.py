"""Interpreter of step functions, for loops over so few rows that compilation takes longer.

A screen simulates each group of prototypes once.  Over 370 samples, the compilation of its loop
takes ten times as long as the passes.  The interpreter is a loop over CasADi's list of operations,
compiled once for all steps; it applies each operation to a block of lanes in memory.

An operation takes about 3 ns and a block of lanes, in compiled code 0.3 to 0.6 ns; to compile it
takes 12 microseconds.
"""

from __future__ import annotations

import ctypes
import functools
import hashlib
from typing import Final

import casadi as ca
import numpy as np

from identification.model.instructions import translated
from identification.model.lowering import (
    BINARY,
    LANES,
    UNARY,
    Operations,
    Value,
    block_type,
)
from identification.model.machine import Loaded, compiled

__all__ = ["Interpreted"]

_BLOCK: Final = block_type(LANES)

_LITERAL, _PARAMETER, _INPUT, _CARRY, _OUTPUT, _NEXT = range(1000, 1006)
"""Codes of the operations that load and store; all others are those of CasADi."""

_ARGUMENTS: Final = (ctypes.c_int64, ctypes.c_int64, *[ctypes.c_void_p] * 7, *[ctypes.c_int64] * 4)


class Interpreted:
    """Step function (carry, input, parameter) -> (carry, output) as a program of the interpreter.

    Raises:
        ComputationError: The step uses an operation that has no translation.
    """

    def __init__(self, step: ca.Function) -> None:
        # Held here: of two machines that threads load at once, the cache keeps only one.
        self._machine = _machine()
        self._widths = step.size1_in(1), step.size1_out(1)
        self._literals: list[float] = []
        self._before: list[tuple[int, int, int, int]] = []
        self._body: list[tuple[int, int, int, int]] = []
        self._fixed: list[bool] = []
        carry, output = translated(step, self._literal, self._loaded, self._operation)
        stores = [(_OUTPUT, row, place, 0) for row, place in enumerate(output)]
        stores += [(_NEXT, row, place, 0) for row, place in enumerate(carry)]
        self._begin = len(self._before)
        self._program = np.array([*self._before, *self._body, *stores], dtype=np.int32)
        self._table = np.array(self._literals)
        # The interpreter reads both operands of each operation, also where they are row numbers.
        self._places = int(self._program[:, 1:].max()) + 1

    def run(self, n: int, stride: int, inputs: int, p: int, carry: int, outputs: int) -> None:
        """Repeat the step for a block of lanes; arguments as of a compiled loop."""
        work = np.empty((self._places, LANES))
        self._machine.run(
            n, stride, inputs, p, carry, outputs,
            self._program.ctypes.data, self._table.ctypes.data, work.ctypes.data,
            self._begin, len(self._program), *self._widths,
        )  # fmt: skip

    def _literal(self, value: float) -> int:
        self._literals.append(value)
        return self._added(_LITERAL, len(self._literals) - 1, fixed=True)

    def _loaded(self, which: int, row: int) -> int:
        return self._added((_CARRY, _INPUT, _PARAMETER)[which], row, fixed=which == 2)

    def _operation(self, operation: int, operands: list[int]) -> int:
        a, b = operands[0], operands[-1]
        return self._added(operation, a, b, fixed=self._fixed[a] and self._fixed[b])

    def _added(self, operation: int, a: int, b: int = 0, *, fixed: bool) -> int:
        """Place of the result of one more operation; a fixed one precedes the loop."""
        place = len(self._fixed)
        (self._before if fixed else self._body).append((operation, place, a, b))
        self._fixed.append(fixed)
        return place


@functools.cache
def _machine() -> Loaded:
    text = _text()
    key = hashlib.sha256(text.encode()).hexdigest()
    return Loaded(compiled(lambda: text, 2, key), _ARGUMENTS)


def _text() -> str:
    """LLVM module of the interpreter: a switch in a loop over operations in a loop over rows."""
    declared: set[str] = set()
    cases, labels = _memory_cases(), [_LITERAL, _PARAMETER, _INPUT, _CARRY, _OUTPUT, _NEXT]
    for code in sorted({*UNARY, *BINARY}):
        own = Operations(f"o{code}_")
        operands = [Value("%a", "lane"), Value("%b", "lane")]
        found = own.operation(code, operands if code in BINARY else operands[:1])
        declared |= own.declared
        cases += [f"case{code}:", *own.lines["lane"]]
        cases += [f"  store {_BLOCK} {found.name}, ptr %target, align 8", "  br label %next"]
        labels.append(code)
    table = " ".join(f"i32 {label}, label %case{label}" for label in labels)
    switch = f"  switch i32 %code, label %next [{table}]"
    return "\n".join([*sorted(declared), _HEAD, switch, *cases, _TAIL, ""])


def _memory_cases() -> list[str]:
    """Cases of the operations that load and store."""
    lines = []
    for code, source in ((_LITERAL, "%literals"), (_INPUT, "%u")):
        lines += [
            f"case{code}:",
            f"  %p{code} = getelementptr double, ptr {source}, i64 %i",
            f"  %x{code} = load double, ptr %p{code}, align 8",
            f"  %s{code} = insertelement {_BLOCK} poison, double %x{code}, i64 0",
            f"  %v{code} = shufflevector {_BLOCK} %s{code}, {_BLOCK} poison, "
            f"<{LANES} x i32> zeroinitializer",
            f"  store {_BLOCK} %v{code}, ptr %target, align 8",
            "  br label %next",
        ]
    pointers = {_PARAMETER: "%p", _CARRY: "%carry", _OUTPUT: "%y", _NEXT: "%carry"}
    for code, pointer in pointers.items():
        is_load = code in (_PARAMETER, _CARRY)
        lines += [
            f"case{code}:",
            f"  %o{code} = mul i64 %stride, {'%i' if is_load else '%d'}",
            f"  %p{code} = getelementptr double, ptr {pointer}, i64 %o{code}",
        ]
        source, target = "%a", f"%p{code}"
        if is_load:
            source, target = f"%v{code}", "%target"
            lines.append(f"  {source} = load {_BLOCK}, ptr %p{code}, align 8")
        lines += [f"  store {_BLOCK} {source}, ptr {target}, align 8", "  br label %next"]
    return lines


_HEAD: Final = f"""\
define void @scan(i64 %n, i64 %stride, ptr %inputs, ptr noalias %p, ptr noalias %carry,
    ptr noalias %outputs, ptr noalias %program, ptr noalias %literals, ptr noalias %work,
    i64 %begin, i64 %end, i64 %n_input, i64 %n_output) "stackrealign" {{
entry:
  %empty = icmp sle i64 %n, 0
  br i1 %empty, label %done, label %rows
rows:
  %row = phi i64 [ -1, %entry ], [ %row1, %latch ]
  %first = icmp slt i64 %row, 0
  %from = select i1 %first, i64 0, i64 %begin
  %to = select i1 %first, i64 %begin, i64 %end
  %uo = mul i64 %row, %n_input
  %u = getelementptr double, ptr %inputs, i64 %uo
  %yw = mul i64 %n_output, %stride
  %yo = mul i64 %row, %yw
  %y = getelementptr double, ptr %outputs, i64 %yo
  br label %loop
loop:
  %k = phi i64 [ %from, %rows ], [ %k1, %next ]
  %ip = getelementptr [4 x i32], ptr %program, i64 %k
  %code = load i32, ptr %ip, align 4
  %dp = getelementptr i32, ptr %ip, i64 1
  %d32 = load i32, ptr %dp, align 4
  %d = sext i32 %d32 to i64
  %target = getelementptr {_BLOCK}, ptr %work, i64 %d
  %i0 = getelementptr i32, ptr %ip, i64 2
  %i32 = load i32, ptr %i0, align 4
  %i = sext i32 %i32 to i64
  %ap = getelementptr {_BLOCK}, ptr %work, i64 %i
  %a = load {_BLOCK}, ptr %ap, align 8
  %j0 = getelementptr i32, ptr %ip, i64 3
  %j32 = load i32, ptr %j0, align 4
  %j = sext i32 %j32 to i64
  %bp = getelementptr {_BLOCK}, ptr %work, i64 %j
  %b = load {_BLOCK}, ptr %bp, align 8"""

_TAIL: Final = """\
next:
  %k1 = add i64 %k, 1
  %more = icmp slt i64 %k1, %to
  br i1 %more, label %loop, label %latch
latch:
  %row1 = add i64 %row, 1
  %again = icmp slt i64 %row1, %n
  br i1 %again, label %rows, label %done
done:
  ret void
}"""
