"""Model equations as MathML, printed from the CasADi expressions that are simulated.

A subexpression that occurs several times becomes a line of its own.  The graph of an expression is
rewritten towards the form of a textbook: exp(p ln(x)) becomes x^p, and two terms under opposite
conditions become one case distinction.
"""

from __future__ import annotations

import html
from collections import Counter
from dataclasses import dataclass, field
from typing import Final, NamedTuple

import casadi as ca

from identification.model.composite import INPUTS, MotorModel
from identification.model.instructions import translated

__all__ = ["printed_equations"]


_BINARY: Final = {
    ca.OP_ADD: "+", ca.OP_SUB: "-", ca.OP_MUL: "*", ca.OP_DIV: "/", ca.OP_POW: "^",
    ca.OP_CONSTPOW: "^", ca.OP_LT: "<", ca.OP_LE: "≤", ca.OP_EQ: "=", ca.OP_FMIN: "min",
    ca.OP_FMAX: "max", ca.OP_IF_ELSE_ZERO: "where",
}  # fmt: skip
_UNARY: Final = {
    ca.OP_NEG: "neg", ca.OP_SQRT: "sqrt", ca.OP_EXP: "exp", ca.OP_LOG: "ln", ca.OP_SIN: "sin",
    ca.OP_COS: "cos", ca.OP_FABS: "abs", ca.OP_TANH: "tanh", ca.OP_SIGN: "sgn", ca.OP_NOT: "not",
}  # fmt: skip
_SIGNS: Final = {"-": "−", "<": "&lt;"}
_SYMBOLS: Final = {
    "current": "i", "speed": "ω", "voltage": "v", "temperature": "T", "angle": "φ", "time": "t",
    "peak_temperature": "T_peak", "temperature_rate": "dT/dt", "voltage_next": "v_next",
    "interval": "h",
}  # fmt: skip
_PARAMETERS: Final = {"Ra25": "R_25", "Kt25": "K_25", "alpha_Ra": "α_R", "alpha_Kt": "α_K"}
_COEFFICIENTS: Final = {_PARAMETERS["Ra25"]: "R_a", _PARAMETERS["Kt25"]: "K_t"}
"""Symbols of the products that begin with a parameter: the coefficients at the temperature."""
_LEAST_SHARED: Final = 3
"""Fewest operations of a repeated subexpression that gets a line of its own."""
_ATOM, _POWER, _PRODUCT, _SUM, _RELATION = 4, 3, 2, 1, 0
"""Binding strength of a printed expression; a weaker one inside a stronger one gets brackets."""


class Node(NamedTuple):
    """Operation or leaf of an expression: its kind, its operands and, of a leaf, its text."""

    kind: str
    children: tuple[int, ...] = ()
    label: str = ""


@dataclass
class Graph:
    """Expression graph in which equal expressions are one node."""

    nodes: list[Node] = field(default_factory=list)
    """The nodes; children stand before their parents."""
    _known: dict[Node, int] = field(default_factory=dict)

    def add(self, kind: str, *children: int, label: str = "") -> int:
        """Index of a node, rewritten if it is an exponential of a logarithm or a pair of cases."""
        if kind == "exp":
            return self._exponential(children[0])
        if kind == "+":
            cases = self._cases(*children) or self._cases(*reversed(children))
            if cases:
                return cases
        return self._index(Node(kind, children, label))

    def _index(self, node: Node) -> int:
        if node not in self._known:
            self._known[node] = len(self.nodes)
            self.nodes.append(node)
        return self._known[node]

    def number(self, value: float) -> int:
        """Index of a constant."""
        return self.add("number", label=f"{value:.6g}")

    def _exponential(self, exponent: int) -> int:
        above, below, sign = self._factors(exponent)
        logarithms = [k for k in above if self.nodes[k].kind == "ln"]
        if len(logarithms) != 1:
            return self._index(Node("exp", (exponent,)))
        above.remove(logarithms[0])
        power = self._product(above)
        if below:
            power = self.add("/", power, self._product(below))
        return self.add(
            "^",
            self.nodes[logarithms[0]].children[0],
            power if sign > 0 else self.add("neg", power),
        )

    def _factors(self, k: int) -> tuple[list[int], list[int], int]:
        """Factors of numerator and denominator, and the sign."""
        node = self.nodes[k]
        if node.kind == "neg":
            above, below, sign = self._factors(node.children[0])
            return above, below, -sign
        if node.kind in "*/" and len(node.children) == 2:
            first, second = (self._factors(child) for child in node.children)
            other = second[:2] if node.kind == "*" else second[1::-1]
            return first[0] + other[0], first[1] + other[1], first[2] * second[2]
        return [k], [], 1

    def _product(self, factors: list[int]) -> int:
        if not factors:
            return self.number(1.0)
        product = factors[0]
        for factor in factors[1:]:
            product = self.add("*", product, factor)
        return product

    def _cases(self, first: int, second: int) -> int | None:
        """Case distinction if the second term holds exactly where the first does not."""
        one, other = self.nodes[first], self.nodes[second]
        if one.kind != "where" or other.kind != "where":
            return None
        condition = self.nodes[other.children[0]]
        if condition != Node("not", (one.children[0],)):
            return None
        return self.add("cases", *one.children, other.children[1])


def printed_equations(model: MotorModel) -> dict[str, str]:
    """State equations, and the sensor equations that differ from the state itself, as MathML.

    By left-hand side, such as ``di/dt`` or ``logged current``; in words where a channel is averaged
    or delayed.
    """
    state, inputs, parameter = model.symbols()
    parameters = _short([p.name for p in model.parameters])
    states = [_SYMBOLS.get(name, name) for name in model.state_names]
    names = (
        states,
        [_SYMBOLS.get(name, name) for name in INPUTS],
        [_PARAMETERS.get(name, name) for name in parameters],
    )
    substeps = inputs[INPUTS.index("substeps")]
    whole = [
        ca.substitute(equations(state, inputs, parameter), substeps, 1)
        for equations in (model.rates, model.logged)
    ]
    function = ca.Function("equations", [state, inputs, parameter], whole)
    graph = Graph()
    rates, logged = translated(
        function,
        graph.number,
        lambda which, row: graph.add("name", label=names[which][row]),
        lambda operation, operands: _operation(graph, operation, operands),
    )
    lefts = {
        f"d{name}/dt": f"<mfrac><mrow><mi>d</mi>{_name(name)}</mrow>"
        "<mrow><mi>d</mi><mi>t</mi></mrow></mfrac>"
        for name in states
    }
    wanted = dict(zip(lefts, rates, strict=True))
    for channel, root in zip(("current", "speed"), logged, strict=True):
        symbol = _SYMBOLS[channel]
        if graph.nodes[root] != Node("name", (), symbol):
            wanted[f"logged {channel}"] = root
            lefts[f"logged {channel}"] = _name(f"{symbol}_logged")
    shared = _shared(graph, list(wanted.values()))
    printer = _Printer(graph, shared)
    equations = {
        left: _math(f"{lefts[left]}<mo>=</mo>{printer.text(root, whole=True)}")
        for left, root in wanted.items()
    }
    for root, name in shared.items():
        equations[name] = _math(f"{_name(name)}<mo>=</mo>{printer.text(root, whole=True)}")
    return equations | _in_words(model)


def _in_words(model: MotorModel) -> dict[str, str]:
    """Sentences on averages, filters of samples and delays, which the equations omit."""
    equations = {}
    for mean in model.averaged.values():
        over = f"2 {mean.name}.time_constant" if mean.parameters else "the sample interval"
        equations[f"{mean.channel} average"] = (
            f"The {mean.channel} channel is the mean over {over} before the sample."
        )
    for digital in model.sample_filters:
        equations[f"{digital.channel} samples"] = (
            f"The samples of the {digital.channel} channel pass a digital filter ({digital.name})."
        )
    if any(term.behind for term in model.voltage_filters):
        equations["voltage samples"] = "v is the voltage of the sample before, v_next the sample's."
    for term in model.delays:
        equations[f"{term.channel} channel"] = (
            f"The {term.channel} channel is logged {term.name}.delay later."
        )
    return equations


def _short(names: list[str]) -> list[str]:
    """Names without the prefix of their effect where that leaves them distinct."""
    bare = [name.rpartition(".")[2] for name in names]
    count = Counter(bare)
    return [
        short if count[short] == 1 or short == name else name
        for name, short in zip(names, bare, strict=True)
    ]


def _operation(graph: Graph, operation: int, operands: list[int]) -> int:
    first = operands[0]
    if operation == ca.OP_SQ:
        return graph.add("^", first, graph.number(2.0))
    if operation == ca.OP_TWICE:
        return graph.add("*", graph.number(2.0), first)
    if operation == ca.OP_INV:
        return graph.add("/", graph.number(1.0), first)
    kind = _BINARY.get(operation) or _UNARY.get(operation) or f"f{operation}"
    return graph.add(kind, *operands)


def _shared(graph: Graph, roots: list[int]) -> dict[int, str]:
    """Nodes with a line of their own and their names, in order of the lines."""
    uses: Counter[int] = Counter(roots)
    reached: set[int] = set()
    stack = list(roots)
    while stack:
        k = stack.pop()
        if k in reached:
            continue
        reached.add(k)
        uses.update(graph.nodes[k].children)
        stack.extend(graph.nodes[k].children)
    size: dict[int, int] = {}
    for k, node in enumerate(graph.nodes):
        size[k] = min(bool(node.children) + sum(size[child] for child in node.children), 1000)
    named = {k: _coefficient(graph, k) for k in sorted(reached)}
    often = {name for name, count in Counter(named.values()).items() if count > 1}
    found: dict[int, str] = {}
    for k, name in named.items():
        if k in roots or size[k] < _LEAST_SHARED:
            continue
        if name and name not in often:
            found[k] = name
        elif uses[k] > 1:
            found[k] = f"u_{sum(known.startswith('u_') for known in found.values()) + 1}"
    return found


def _coefficient(graph: Graph, k: int) -> str:
    """Symbol of Ra(T) or Kt(T) if the node is this product; empty otherwise."""
    node = graph.nodes[k]
    if node.kind != "*":
        return ""
    first = graph.nodes[node.children[0]]
    return _COEFFICIENTS.get(first.label, "") if first.kind == "name" else ""


class _Printer:
    """MathML of the nodes of a graph."""

    def __init__(self, graph: Graph, shared: dict[int, str]) -> None:
        self._graph, self._shared = graph, shared

    def text(self, k: int, strength: int = _RELATION, *, whole: bool = False) -> str:
        """MathML of a node, in brackets if it binds less than `strength`.

        A shared node is printed by its name, except with `whole`.
        """
        if k in self._shared and not whole:
            return _name(self._shared[k])
        content, own = self._printed(self._graph.nodes[k])
        content = f"<mrow>{content}</mrow>"
        return content if own >= strength else f"<mrow><mo>(</mo>{content}<mo>)</mo></mrow>"

    def _printed(self, node: Node) -> tuple[str, int]:
        kind, children = node.kind, node.children
        if kind == "number":
            return _number(node.label)
        if kind == "name":
            return _name(node.label), _ATOM
        if kind in "+-<≤=":
            left = _RELATION + 1 if kind in "<≤=" else _SUM
            first = self.text(children[0], left)
            second = self.text(children[1], left + (kind == "-"))
            return f"{first}<mo>{_SIGNS.get(kind, kind)}</mo>{second}", left - (kind in "<≤=")
        if kind == "*":
            first, second = (self.text(child, _PRODUCT) for child in children)
            return f"{first}<mspace width='0.2em'/>{second}", _PRODUCT
        if kind == "/":
            first, second = (self.text(child) for child in children)
            return f"<mfrac>{first}{second}</mfrac>", _POWER
        if kind == "^":
            return f"<msup>{self.text(children[0], _ATOM)}{self.text(children[1])}</msup>", _POWER
        return self._function(kind, children)

    def _function(self, kind: str, children: tuple[int, ...]) -> tuple[str, int]:
        inside = [self.text(child) for child in children]
        if kind == "neg":
            return f"<mo>−</mo>{self.text(children[0], _PRODUCT)}", _SUM
        if kind == "not":
            return f"<mtext>not&#160;</mtext>{self.text(children[0], _ATOM)}", _RELATION
        if kind == "exp":
            return f"<msup><mi>e</mi>{inside[0]}</msup>", _POWER
        if kind == "sqrt":
            return f"<msqrt>{inside[0]}</msqrt>", _ATOM
        if kind == "abs":
            return f"<mo>|</mo>{inside[0]}<mo>|</mo>", _ATOM
        if kind == "where":
            inside.append("<mn>0</mn>")
            kind = "cases"
        if kind == "cases":
            rows = (
                f"<mtr><mtd>{inside[1]}</mtd><mtd><mtext>&#160;if&#160;</mtext>{inside[0]}</mtd></mtr>"
                f"<mtr><mtd>{inside[2]}</mtd><mtd><mtext>&#160;otherwise</mtext></mtd></mtr>"
            )
            return f"<mo>{{</mo><mtable>{rows}</mtable>", _RELATION
        arguments = "<mo>,</mo>".join(inside)
        return f"<mi>{html.escape(kind)}</mi><mo>(</mo>{arguments}<mo>)</mo>", _ATOM


def _math(content: str) -> str:
    return f'<math display="block">{content}</math>'


def _name(name: str) -> str:
    """A symbol with its index, or a name of several letters with its effect as the index."""
    effect, _, bare = name.rpartition(".")
    base, _, index = bare.partition("_")
    if effect:
        base, index = bare, effect
    elif len(base) > 1 and not index.isdigit():
        base, index = bare, ""
    base, index = (html.escape(words.replace("_", " ")) for words in (base, index))
    return f"<msub><mi>{base}</mi><mtext>{index}</mtext></msub>" if index else f"<mi>{base}</mi>"


def _number(label: str) -> tuple[str, int]:
    digits, _, power = label.partition("e")
    sign = "<mo>−</mo>" if digits.startswith("-") else ""
    shown = f"{sign}<mn>{digits.lstrip('-')}</mn>"
    if not power:
        return shown, _SUM if sign else _ATOM
    exponent = (
        f"<mrow>{'<mo>−</mo>' if power[0] == '-' else ''}<mn>{int(power.strip('+-'))}</mn></mrow>"
    )
    ten = f"<msup><mn>10</mn>{exponent}</msup>"
    return (ten if digits == "1" else f"{shown}<mo>×</mo>{ten}"), _PRODUCT
