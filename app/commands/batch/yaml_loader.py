"""YAML loader for manifests: the safe loader of PyYAML with further restrictions."""

from __future__ import annotations

from typing import Any

import yaml

__all__ = ["ManifestLoader"]

_LONGEST_SCALAR = 10_000


class ManifestLoader(yaml.SafeLoader):
    """Loader that rejects aliases, very long scalars and duplicate keys with their line.

    Nested aliases in a few lines can expand beyond any memory.  A base-60 integer such as
    ``1:1:1`` takes a conversion time quadratic in its length.  Of two equal keys, PyYAML silently
    keeps the last.
    """

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        """Compose the next node; reject aliases and very long scalars."""
        event: yaml.Event = self.peek_event()  # type: ignore[no-untyped-call]
        if isinstance(event, yaml.AliasEvent):
            raise _fault("has an alias; expected each value written out", event)
        if isinstance(event, yaml.ScalarEvent) and len(event.value) > _LONGEST_SCALAR:
            raise _fault(f"has a value of more than {_LONGEST_SCALAR} characters", event)
        return super().compose_node(parent, index)

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        """Construct a mapping; reject duplicate keys."""
        found = set()
        for key_node, _ in node.value:
            if not isinstance(key_node, yaml.ScalarNode):
                continue
            key = self.construct_object(key_node)
            if key in found:
                raise _fault(f"has the key {str(key)[:60]!r} twice; expected it once", key_node)
            found.add(key)
        return super().construct_mapping(node, deep)


def _fault(problem: str, place: yaml.Event | yaml.Node) -> yaml.MarkedYAMLError:
    return yaml.MarkedYAMLError(None, None, problem, place.start_mark)  # type: ignore[arg-type]
