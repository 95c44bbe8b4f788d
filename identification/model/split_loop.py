"""LLVM loop over time whose state is one for all lanes and whose tangents have one lane each.

The directions of a tangent share the state, the parameters and every coefficient that multiplies
them.  These are scalars here: computed before the loop or once per row.  A loop over blocks of
lanes inside the loop over rows applies the coefficients to the tangents.  A plain loop would repeat
the scalars for each block of lanes.
"""

from __future__ import annotations

from typing import Final

import casadi as ca

from identification.model.instructions import translated
from identification.model.lowering import LANES, Operations, Value, literal

__all__ = ["lower_split"]

_X, _SLOPE, _U, _P, _SEED = range(5)


class _Split(Operations):
    """LLVM instructions of a step (state, slope, input, parameter, seed) -> (the same, outputs).

    State, input and parameter are scalars; slope and seed have lanes.  A scalar reaches the lanes
    through memory, from which each use broadcasts it.
    """

    def __init__(self, step: ca.Function) -> None:
        super().__init__("r")
        state, slope, output, tangent = translated(
            step, literal, self._input, self.operation, self.choice
        )
        self.slopes = [self._as_vector(value) for value in slope]
        self.tangents = [self._as_vector(value) for value in tangent]
        self.states, self.outputs = ([value.name for value in each] for each in (state, output))

    @property
    def slots(self) -> int:
        """Scalars that the lanes use."""
        return len(self._spread)

    def _is_scalar(self, stage: str) -> bool:
        return stage != "lane"

    def _stage_of(self, operands: list[Value]) -> str:
        found = "constant"
        for _, stage in operands:
            if stage == "lane":
                return stage
            if stage == "shared":
                found = stage
        return found

    def _as_vector(self, value: Value) -> str:
        if value.stage in ("literal", "lane"):
            return super()._as_vector(value)
        if value.name not in self._spread:
            slot, place = len(self._spread), self._new()
            self.lines[value.stage] += [
                f"  {place} = getelementptr double, ptr %scratch, i64 {slot}",
                f"  store double {value.name}, ptr {place}, align 8",
            ]
            address = self._emit("lane", f"getelementptr double, ptr %scratch, i64 {slot}")
            loaded = self._emit("lane", f"load double, ptr {address.name}, align 8")
            single = self._emit(
                "lane", f"insertelement {self.vector} poison, double {loaded.name}, i64 0"
            )
            self._spread[value.name] = self._emit(
                "lane",
                f"shufflevector {self.vector} {single.name}, {self.vector} poison, "
                f"<{self.lanes} x i32> zeroinitializer",
            ).name
        return self._spread[value.name]

    def _input(self, which: int, row: int) -> Value:
        if which == _X:
            return Value(f"%x{row}", "shared")
        if which == _U:
            address = self._emit("shared", f"getelementptr double, ptr %u, i64 {row}")
            return self._emit("shared", f"load double, ptr {address.name}, align 8")
        if which == _P:
            address = self._emit("constant", f"getelementptr double, ptr %p, i64 {row}")
            return self._emit("constant", f"load double, ptr {address.name}, align 8")
        base = "%slope" if which == _SLOPE else "%seed"
        offset = self._emit("constant", f"mul i64 %stride, {row}")
        place = self._emit("lane", f"add i64 {offset.name}, %j")
        address = self._emit("lane", f"getelementptr double, ptr {base}, i64 {place.name}")
        return self._emit("lane", f"load {self.vector}, ptr {address.name}, align 8")


def lower_split(step: ca.Function) -> str:
    """LLVM module with a function ``scan`` that repeats `step` over time.

    The step is an SX function (state, slope, input, parameter, seed) -> (state, slope, output,
    tangent).  Slope, seed and tangent have lanes; a tangent is linear in slope and seed.

    Raises:
        ComputationError: The step uses an operation that has no translation.
    """
    body = _Split(step)
    states = range(len(body.states))
    parts = [
        [*sorted(body.declared), _HEAD, "entry:"],
        [f"  %scratch = alloca [{max(body.slots, 1)} x double], align 64"],
        _loaded_states(len(states)),
        [f"  %so{row} = mul i64 %stride, {row}" for row in range(len(body.slopes))],
        [f"  %to{row} = mul i64 %stride, {row}" for row in range(len(body.tangents))],
        body.lines["constant"],
        _rows(len(body.tangents)),
        [
            f"  %x{row} = phi double [ %xs{row}, %entry ], [ {name}, %latch ]"
            for row, name in enumerate(body.states)
        ],
        body.lines["shared"],
        _stored("%y", body.outputs, "double", "y"),
        ["  br label %lanes", "lanes:", "  %j = phi i64 [ 0, %loop ], [ %j1, %lanes ]"],
        body.lines["lane"],
        _stored("%slope", body.slopes, body.vector, "s"),
        _stored("%t", body.tangents, body.vector, "t"),
        _row_ends(step.size1_in(_U), len(body.outputs)),
        [
            f"  %xf{row} = phi double [ %xs{row}, %entry ], [ {name}, %latch ]"
            for row, name in enumerate(body.states)
        ],
        [f"  store double %xf{row}, ptr %xa{row}, align 8" for row in states],
        ["  ret void", "}", ""],
    ]
    return "\n".join([line for part in parts for line in part])


def _loaded_states(number: int) -> list[str]:
    """Instructions that load the states before the first row."""
    lines: list[str] = []
    for row in range(number):
        lines += [
            f"  %xa{row} = getelementptr double, ptr %state, i64 {row}",
            f"  %xs{row} = load double, ptr %xa{row}, align 8",
        ]
    return lines


def _rows(n_output: int) -> list[str]:
    """Begin of the loop over rows."""
    return [
        f"  %yw = mul i64 %stride, {n_output}",
        "  %empty = icmp sle i64 %n, 0",
        "  br i1 %empty, label %done, label %loop",
        "loop:",
        "  %k = phi i64 [ 0, %entry ], [ %k1, %latch ]",
        "  %u = phi ptr [ %inputs, %entry ], [ %u1, %latch ]",
        "  %y = phi ptr [ %outputs, %entry ], [ %y1, %latch ]",
        "  %t = phi ptr [ %tangents, %entry ], [ %t1, %latch ]",
    ]


def _stored(base: str, names: list[str], kind: str, prefix: str) -> list[str]:
    """Instructions that store values row by row, those of lanes at the lane %j of each row."""
    lines: list[str] = []
    for row, name in enumerate(names):
        place = str(row)
        if kind != "double":
            place = f"%{prefix}p{row}"
            lines.append(f"  {place} = add i64 %{prefix}o{row}, %j")
        lines += [
            f"  %{prefix}a{row} = getelementptr double, ptr {base}, i64 {place}",
            f"  store {kind} {name}, ptr %{prefix}a{row}, align 8",
        ]
    return lines


def _row_ends(n_input: int, n_output: int) -> list[str]:
    """End of the loops over lanes and rows."""
    return [
        f"  %j1 = add i64 %j, {LANES}",
        "  %further = icmp slt i64 %j1, %width",
        "  br i1 %further, label %lanes, label %latch",
        "latch:",
        "  %k1 = add i64 %k, 1",
        f"  %u1 = getelementptr double, ptr %u, i64 {n_input}",
        f"  %y1 = getelementptr double, ptr %y, i64 {n_output}",
        "  %t1 = getelementptr double, ptr %t, i64 %yw",
        "  %more = icmp slt i64 %k1, %n",
        "  br i1 %more, label %loop, label %done",
        "done:",
    ]


_HEAD: Final = (
    "define void @scan(i64 %n, i64 %stride, i64 %width, ptr noalias %inputs, ptr noalias %p, "
    "ptr noalias %seed, ptr noalias %state, ptr noalias %slope, ptr noalias %outputs, "
    'ptr noalias %tangents) "stackrealign" {'
)
