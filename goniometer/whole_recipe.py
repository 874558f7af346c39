"""A recipe that was put together of several files: where each key stands, and its lines there."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import yaml

from goniometer.yaml_file import UNREAD, Fault, KeyPath, YamlFile
from goniometer.yaml_nodes import composed


@dataclass(frozen=True)
class WholeRecipe(YamlFile):
    """A recipe with what it includes, whose faults are reported in the file, and at the line, where each key stands."""

    sources: Mapping[str | int, YamlFile] = field(default_factory=dict)
    table: Path | None = None

    def fault(self, place: KeyPath, what: str) -> Fault:
        """Say what is wrong at a place of whichever file holds it."""
        if self.table is not None and place[:1] == ("points",):
            place = ("points_file",)
        source = self.sources.get(place[0]) if place else None
        return YamlFile.fault(self, place, what) if source is None else source.fault(place, what)


def texts_of_keys(file: YamlFile) -> dict[str | int, str]:
    """The lines of each key at the top of a file, up to the next one, with the comments between them."""
    root, _ = composed(file.text)
    assert isinstance(root, yaml.MappingNode), "a file with data begins with a key"
    data = file.data or {}
    if root.flow_style:
        return {
            key: yaml.safe_dump({key: value}, allow_unicode=True) for key, value in data.items() if value is not UNREAD
        }
    lines = file.text.splitlines(keepends=True)
    keys = [key for key, _ in root.value if isinstance(key, yaml.ScalarNode)]
    firsts = [key.start_mark.line for key in keys]
    pieces: dict[str | int, str] = dict.fromkeys(data, "")
    for key, first, end in zip(keys, firsts, [*firsts[1:], len(lines)], strict=True):
        pieces.setdefault(key.value, "")
        pieces[key.value] = "".join(lines[first:end])
    return pieces
