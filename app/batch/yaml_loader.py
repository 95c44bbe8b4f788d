"""Loader of YAML manifests: the safe loader of PyYAML without what a manifest has no use for."""

from __future__ import annotations

from typing import Any

import yaml

__all__ = ["ManifestLoader"]

_LONGEST_SCALAR = 10_000


class ManifestLoader(yaml.SafeLoader):
    """Refuses aliases, huge scalars and keys that are there twice, each with its line.

    A few lines of aliases stand for more than any memory holds, a whole number such as ``1:1:1`` is
    converted in a time that grows with the square of its length, and of two equal keys YAML as
    PyYAML reads it keeps the last without a word.
    """

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        """Make a node of the next events."""
        event: yaml.Event = self.peek_event()  # type: ignore[no-untyped-call]
        if isinstance(event, yaml.AliasEvent):
            raise _fault("has an alias where each value is to be written out", event)
        if isinstance(event, yaml.ScalarEvent) and len(event.value) > _LONGEST_SCALAR:
            raise _fault(f"has a value of more than {_LONGEST_SCALAR} characters", event)
        return super().compose_node(parent, index)

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        """Make a mapping of a node, each key of which is there once."""
        found = set()
        for key_node, _ in node.value:
            if not isinstance(key_node, yaml.ScalarNode):
                continue
            key = self.construct_object(key_node)
            if key in found:
                raise _fault(f"has the key {str(key)[:60]!r} twice; keep one", key_node)
            found.add(key)
        return super().construct_mapping(node, deep)


def _fault(problem: str, place: yaml.Event | yaml.Node) -> yaml.MarkedYAMLError:
    return yaml.MarkedYAMLError(None, None, problem, place.start_mark)  # type: ignore[arg-type]
