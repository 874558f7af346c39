"""The nodes of a YAML text, with a placeholder for everything these files may not hold."""

from __future__ import annotations

from contextlib import suppress
from typing import Any

import yaml

MAX_DEPTH = 20
ALIAS, TAGGED = "alias", "tagged"
"""Tags of what stands in place of an alias, and of a value with a tag."""

_TOO_DEEP = "too deep"

_LONG = 20_000
"""Characters of a text that takes long to read."""


def composed(text: str) -> tuple[yaml.Node | None, Any]:
    """The first document, and the event with which a second one begins, or None.

    Long texts are read in C, unless something is wrong with them: only the messages of the other loader are explained.

    Raises
    ------
    yaml.YAMLError
        When the text is not YAML.
    """
    if _QUICK is not None and len(text) > _LONG:
        with suppress(yaml.YAMLError):
            return _documents(_QUICK(text))
    return _documents(_Loader(text))


def _documents(loader: Any) -> tuple[yaml.Node | None, Any]:
    root = loader.get_node() if loader.check_node() else None
    return root, loader.peek_event() if root is not None and loader.check_node() else None


class _Nodes(yaml.composer.Composer):
    """Composes nodes; constructs nothing."""

    _depth = 0

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        events: Any = self
        event = events.peek_event()
        if events.check_event(yaml.AliasEvent):
            events.get_event()
            return yaml.ScalarNode(ALIAS, f"*{event.anchor}", event.start_mark, event.end_mark)
        if self._depth == MAX_DEPTH:
            raise yaml.composer.ComposerError(None, None, _TOO_DEEP, event.start_mark)
        self._depth += 1
        node = super().compose_node(parent, index)
        self._depth -= 1
        if event.tag is not None:
            return yaml.ScalarNode(TAGGED, event.tag, event.start_mark, event.end_mark)
        return node


class _Loader(_Nodes, yaml.SafeLoader):
    """Reads text in Python."""


def _quick() -> Any:
    """A loader that reads text in C, several times as fast; None where PyYAML was built without it."""
    if not yaml.__with_libyaml__:
        return None

    class Quick(_Nodes, yaml.CSafeLoader):
        def __init__(self, text: str) -> None:
            yaml.CSafeLoader.__init__(self, text)
            self.anchors: dict[Any, yaml.Node] = {}  # the part that composes begins with none

    return Quick


_QUICK = _quick()
