"""Translation of CasADi's scalar operations into LLVM instructions on blocks of lanes.

Each operation belongs to one of three classes, according to what it depends on:

    constant   parameters only       computed for a block of lanes before the loop
    shared     inputs only           one scalar per step, broadcast to the lanes that use it
    lane       anything else         computed for a block of lanes in every step

`loop.py` puts the instructions into loops over time.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import Final, NamedTuple

import casadi as ca

from identification.errors import ComputationError
from identification.model.instructions import translated
from identification.model.machine import vector_functions, vector_width

__all__ = [
    "BINARY",
    "LANES",
    "UNARY",
    "Operations",
    "Translation",
    "Value",
    "block_type",
    "literal",
]

LANES: Final = 8
"""Lanes of one block: two AVX2 registers, so that two independent chains hide the latency."""

_SCALAR = "double"
# Fused multiply-add is the only relaxation allowed: NaN and infinity must propagate, because they
# are how a diverging simulation is detected.
_FLAGS = "contract"

_BINARY = {ca.OP_ADD: "fadd", ca.OP_SUB: "fsub", ca.OP_MUL: "fmul", ca.OP_DIV: "fdiv"}
_COMPARE = {ca.OP_LT: "olt", ca.OP_LE: "ole", ca.OP_EQ: "oeq", ca.OP_NE: "une"}
_INTRINSIC = {
    ca.OP_EXP: "exp",
    ca.OP_LOG: "log",
    ca.OP_SIN: "sin",
    ca.OP_COS: "cos",
    ca.OP_SQRT: "sqrt",
    ca.OP_FABS: "fabs",
    ca.OP_FLOOR: "floor",
    ca.OP_CEIL: "ceil",
}
_INTRINSIC_2 = {
    ca.OP_POW: "pow",
    ca.OP_CONSTPOW: "pow",
    ca.OP_FMIN: "minnum",
    ca.OP_FMAX: "maxnum",
    ca.OP_COPYSIGN: "copysign",
}


UNARY: Final = (
    *_INTRINSIC, ca.OP_ASSIGN, ca.OP_NEG, ca.OP_SQ, ca.OP_TWICE, ca.OP_INV, ca.OP_TANH, ca.OP_SIGN,
    ca.OP_NOT,
)  # fmt: skip
"""Operations of one operand that have a translation."""

BINARY: Final = (*_BINARY, *_COMPARE, *_INTRINSIC_2, ca.OP_AND, ca.OP_OR, ca.OP_IF_ELSE_ZERO)
"""Operations of two operands that have a translation."""


def block_type(lanes: int) -> str:
    """LLVM type of a block of lanes."""
    return f"<{lanes} x double>"


class Value(NamedTuple):
    """Operand: its name in the LLVM text, and constant, shared, lane or literal."""

    name: str
    stage: str


class Operations:
    """LLVM instructions of scalar operations, by class; the prefix is that of the registers.

    Attributes:
        lanes: Number of lanes of a block.
        vector: LLVM type of a block of lanes.
    """

    def __init__(self, prefix: str, lanes: int = LANES) -> None:
        self.lanes, self.vector = lanes, block_type(lanes)
        self._mask = f"<{lanes} x i1>"
        self.lines: dict[str, list[str]] = {"constant": [], "shared": [], "lane": []}
        self.declared: set[str] = set()
        self._prefix = prefix
        self._count = 0
        self._spread: dict[str, str] = {}
        self._literals: dict[str, str] = {}
        self._inverse: dict[str, Value] = {}

    def _is_scalar(self, stage: str) -> bool:
        """True for a class whose values are the same in all lanes and held as one number."""
        return stage == "shared"

    def _stage_of(self, operands: list[Value]) -> str:
        """Class of an operation on these operands: lane if theirs differ; literals have none."""
        found = "literal"
        for _, stage in operands:
            if found == "literal":
                found = stage
            elif stage not in (found, "literal"):
                return "lane"
        return "shared" if found == "literal" else found

    def _types(self, stage: str) -> tuple[str, str]:
        """LLVM types of the values of a class and of its conditions."""
        return (_SCALAR, "i1") if self._is_scalar(stage) else (self.vector, self._mask)

    def _names(self, stage: str, operands: list[Value]) -> list[str]:
        """Names of the operands of an operation of a class."""
        if self._is_scalar(stage):
            return [name for name, _ in operands]
        return [self._as_vector(value) for value in operands]

    def _new(self) -> str:
        self._count += 1
        return f"%{self._prefix}{self._count}"

    def _emit(self, stage: str, expression: str) -> Value:
        name = self._new()
        self.lines[stage].append(f"  {name} = {expression}")
        return Value(name, stage)

    def _as_vector(self, value: Value) -> str:
        if value.stage == "literal":
            if value.name not in self._literals:
                self._literals[value.name] = f"<{', '.join([f'double {value.name}'] * self.lanes)}>"
            return self._literals[value.name]
        if value.stage != "shared":
            return value.name
        if value.name not in self._spread:
            lines = self.lines["shared"]
            single, spread = self._new(), self._new()
            lines.append(
                f"  {single} = insertelement {self.vector} poison, double {value.name}, i64 0"
            )
            lines.append(
                f"  {spread} = shufflevector {self.vector} {single}, {self.vector} poison, "
                f"<{self.lanes} x i32> zeroinitializer"
            )
            self._spread[value.name] = spread
        return self._spread[value.name]

    def operation(self, operation: int, operands: list[Value]) -> Value:
        """Append the instructions of one operation of CasADi and return its result.

        Raises:
            ComputationError: The operation has no translation.
        """
        stage = self._stage_of(operands)
        if operation == ca.OP_DIV and operands[1].stage != stage:
            inverse = self._reciprocal(operands[1])
            return self.operation(ca.OP_MUL, [operands[0], inverse])
        if operation == ca.OP_IF_ELSE_ZERO:
            return self.choice(operands[0], operands[1], _ZERO)
        kind, mask = self._types(stage)
        names = self._names(stage, operands)
        word = _BINARY.get(operation)
        if word is not None:
            return self._emit(stage, f"{word} {_FLAGS} {kind} {names[0]}, {names[1]}")

        def emit(expression: str) -> Value:
            return self._emit(stage, expression)

        def number(x: float) -> str:
            value = literal(x)
            return value.name if kind == _SCALAR else self._as_vector(value)

        if operation in _INTRINSIC:
            return self._called(_INTRINSIC[operation], kind, names[:1], emit)
        if operation in _INTRINSIC_2:
            return self._called(_INTRINSIC_2[operation], kind, names[:2], emit)
        if operation in _COMPARE:
            bit = emit(f"fcmp {_COMPARE[operation]} {kind} {names[0]}, {names[1]}")
            return emit(f"uitofp {mask} {bit.name} to {kind}")
        return self._rewritten(operation, names, kind, mask, emit, number)

    def choice(self, condition: Value, chosen: Value, otherwise: Value) -> Value:
        """Append the instructions of one conditional value and return it."""
        operands = [condition, chosen, otherwise]
        stage = self._stage_of(operands)
        kind, mask = self._types(stage)
        at, first, second, zero = self._names(stage, [*operands, _ZERO])
        bit = self._emit(stage, f"fcmp une {kind} {at}, {zero}")
        return self._emit(stage, f"select {mask} {bit.name}, {kind} {first}, {kind} {second}")

    def _reciprocal(self, value: Value) -> Value:
        """Reciprocal of a divisor, computed in the divisor's own class.

        One division before the loop, or one per step, replaces one per lane and step.
        """
        if value.name not in self._inverse:
            self._inverse[value.name] = self.operation(ca.OP_INV, [value])
        return self._inverse[value.name]

    def _rewritten(
        self,
        operation: int,
        names: list[str],
        kind: str,
        mask: str,
        emit: Callable[[str], Value],
        number: Callable[[float], str],
    ) -> Value:
        """Translate an operation without an LLVM counterpart into operations that have one."""
        first = names[0]
        simple = {
            ca.OP_ASSIGN: f"fadd {kind} {first}, {number(-0.0)}",
            ca.OP_NEG: f"fneg {kind} {first}",
            ca.OP_SQ: f"fmul {_FLAGS} {kind} {first}, {first}",
            ca.OP_TWICE: f"fadd {_FLAGS} {kind} {first}, {first}",
            ca.OP_INV: f"fdiv {_FLAGS} {kind} {number(1.0)}, {first}",
        }
        if operation in simple:
            return emit(simple[operation])
        if operation == ca.OP_TANH:
            double = emit(f"fmul {kind} {first}, {number(2.0)}")
            power = self._called("exp", kind, [double.name], emit)
            below = emit(f"fadd {kind} {power.name}, {number(1.0)}")
            part = emit(f"fdiv {kind} {number(2.0)}, {below.name}")
            return emit(f"fsub {kind} {number(1.0)}, {part.name}")
        if operation == ca.OP_SIGN:
            above = emit(f"fcmp ogt {kind} {first}, {number(0.0)}")
            below = emit(f"fcmp olt {kind} {first}, {number(0.0)}")
            up = emit(f"uitofp {mask} {above.name} to {kind}")
            down = emit(f"uitofp {mask} {below.name} to {kind}")
            return emit(f"fsub {kind} {up.name}, {down.name}")
        if operation == ca.OP_NOT:
            bit = emit(f"fcmp oeq {kind} {first}, {number(0.0)}")
            return emit(f"uitofp {mask} {bit.name} to {kind}")
        if operation in (ca.OP_AND, ca.OP_OR):
            word = "and" if operation == ca.OP_AND else "or"
            left = emit(f"fcmp une {kind} {first}, {number(0.0)}")
            right = emit(f"fcmp une {kind} {names[1]}, {number(0.0)}")
            bit = emit(f"{word} {mask} {left.name}, {right.name}")
            return emit(f"uitofp {mask} {bit.name} to {kind}")
        raise ComputationError(
            f"operation {operation} of a model has no translation; expected arithmetic, exp, log, "
            "sin, cos, tanh, sqrt, powers, comparisons or if_else: write the term with those"
        )

    def _called(
        self, name: str, kind: str, operands: list[str], emit: Callable[[str], Value]
    ) -> Value:
        """Call of a function of one or two operands, in a vector version if the machine has one."""
        symbol = None if kind == _SCALAR else vector_functions().get(name)
        width = vector_width()
        if symbol is None:
            suffix = "f64" if kind == _SCALAR else f"v{self.lanes}f64"
            return emit(self._call(f"llvm.{name}.{suffix}", kind, operands))
        parts = [operands]
        if width < self.lanes:
            firsts = range(0, self.lanes, width)
            parts = [[emit(self._part(x, k, width)).name for x in operands] for k in firsts]
        found = [emit(self._call(symbol, block_type(width), part)) for part in parts]
        while len(found) > 1:
            pairs = zip(found[::2], found[1::2], strict=True)
            found = [emit(_joined(a.name, b.name, width)) for a, b in pairs]
            width *= 2
        return found[0]

    def _part(self, operand: str, first: int, width: int) -> str:
        """Some lanes of a block."""
        lanes = ", ".join(f"i32 {first + lane}" for lane in range(width))
        vector = self.vector
        return f"shufflevector {vector} {operand}, {vector} poison, <{width} x i32> <{lanes}>"

    def _call(self, symbol: str, kind: str, operands: list[str]) -> str:
        self.declared.add(f"declare {kind} @{symbol}({', '.join([kind] * len(operands))})")
        return f"call {kind} @{symbol}({', '.join(f'{kind} {operand}' for operand in operands)})"


class Translation(Operations):
    """LLVM instructions of a SX function (carry, input, parameter) -> (carry, output).

    The registers have a prefix; `pointer` is the name of the pointer to the row of inputs.  Given
    parameters are registers ``%q0``, ``%q1``, ... that change from step to step; otherwise they are
    loaded before the loop.

    Raises:
        ComputationError: The function uses an operation that has no translation.
    """

    def __init__(
        self,
        step: ca.Function,
        lanes: int,
        prefix: str = "r",
        pointer: str = "%u",
        *,
        given: bool = False,
    ) -> None:
        super().__init__(prefix, lanes)
        self._pointer, self._given = pointer, given
        found = translated(step, literal, self._input, self.operation, self.choice)
        self.carry, self.output = ([self._as_vector(value) for value in each] for each in found)

    def _input(self, which: int, row: int) -> Value:
        if which == 0:
            return Value(f"%carry{row}", "lane")
        if which == 2 and self._given:
            return Value(f"%q{row}", "lane")
        if which == 1:
            address = self._emit("shared", f"getelementptr double, ptr {self._pointer}, i64 {row}")
            return self._emit("shared", f"load double, ptr {address.name}, align 8")
        offset = self._emit("constant", f"mul i64 %stride, {row}")
        address = self._emit("constant", f"getelementptr double, ptr %p, i64 {offset.name}")
        return self._emit("constant", f"load {self.vector}, ptr {address.name}, align 8")


def _joined(first: str, second: str, width: int) -> str:
    """The lanes of two vectors of equal width."""
    part = block_type(width)
    lanes = ", ".join(f"i32 {lane}" for lane in range(2 * width))
    return f"shufflevector {part} {first}, {part} {second}, <{2 * width} x i32> <{lanes}>"


def literal(x: float) -> Value:
    """Number in LLVM's exact hexadecimal notation."""
    return Value(f"0x{struct.pack('>d', float(x)).hex().upper()}", "literal")


_ZERO: Final = literal(0.0)
