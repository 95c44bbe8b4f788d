"""Graph of an expression, rewritten towards the form of a textbook.

exp(p ln(x)) becomes x^p, and two terms under opposite conditions become one case distinction.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

__all__ = ["Graph", "Node"]


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
