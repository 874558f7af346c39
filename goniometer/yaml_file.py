"""A YAML file read strictly: every key and value keeps its line, and all faults are found at once."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from goniometer.yaml_nodes import ALIAS, TAGGED, composed
from goniometer.yaml_scalar import Scalar, read_scalar
from goniometer.yaml_syntax import explain_character, explain_syntax, lines_indented_with_tabs

MAX_BYTES = 1_000_000

KeyPath = tuple[str | int, ...]
"""The keys (and, in lists, the numbers of the items) that lead from the top of a file to a value."""

UNREAD = object()
"""Stands in `YamlFile.data` for a value that could not be read, and is valid nowhere."""


@dataclass(frozen=True)
class Fault:
    """One thing that is wrong in a file; `line` is None when it is the file itself."""

    file: str
    line: int | None
    text: str

    def __str__(self) -> str:
        place = self.file if self.line is None else f"{self.file}:{self.line}"
        return f"{place}: {self.text}"


@dataclass(frozen=True)
class YamlFile:
    """A file's content with the line of everything in it.

    `data` is None when the file could not be read at all; `faults` then says why. `unread` holds the places whose
    values could not be read; `faults` names them.
    """

    path: Path
    text: str = ""
    data: dict[str | int, Any] | None = None
    lines: Mapping[KeyPath, int] = field(default_factory=lambda: {(): 1})
    faults: tuple[Fault, ...] = ()
    unread: frozenset[KeyPath] = frozenset()

    def fault(self, place: KeyPath, what: str) -> Fault:
        """Say what is wrong at a place of the file; a place that is missing gets the line of what should hold it."""
        present = place
        while present not in self.lines:
            present = present[:-1]
        return Fault(str(self.path), self.lines[present], f"{named(place)}{what}")


def named(place: KeyPath) -> str:
    """How a message names a place: ``key 'exit.step_deg': ``, and nothing for the file as a whole."""
    if not place:
        return ""
    name = "".join(f"[{key}]" if isinstance(key, int) else f".{key}" for key in place).lstrip(".")
    return f"key {name!r}: "


def read_yaml(path: Path) -> YamlFile:
    """Read a YAML file of keys and values; never raises, all that is wrong is in the result's `faults`.

    Only plain data is read: tags, anchors' aliases and merge keys are faults, so a file can neither run code nor unfold
    to more than what is written in it.
    """
    try:
        text = _read_text(path)
    except UnicodeDecodeError as error:
        line = error.object.count(b"\n", 0, error.start) + 1
        what = "is not UTF-8 text. Save the file with the encoding UTF-8"
        return YamlFile(path, faults=(Fault(str(path), line, what),))
    except (OSError, ValueError) as error:
        return YamlFile(path, faults=(Fault(str(path), None, _explain_unreadable(error)),))
    return _parse(path, text)


def _read_text(path: Path) -> str:
    if not path.exists():
        raise FileNotFoundError
    if not path.is_file():
        raise IsADirectoryError
    with path.open("rb") as stream:
        content = stream.read(MAX_BYTES + 1)
    if len(content) > MAX_BYTES:
        raise ValueError(
            f"is larger than {MAX_BYTES} bytes, which no file of this kind is. A long list of directions belongs in a "
            "table beside the recipe (points_file)"
        )
    # utf-8-sig drops the byte order mark that some editors put at the beginning.
    return content.decode("utf-8-sig")


def _explain_unreadable(error: Exception) -> str:
    match error:
        case FileNotFoundError():
            return "does not exist. Check the name; in a file, a relative path starts at that file's folder"
        case IsADirectoryError():
            return "is not a file but a folder or a device. Write the name of a YAML file"
        case PermissionError():
            return "may not be read by you. Ask for permission to read it"
        case OSError():
            return f"cannot be read: {error.strerror or error}"
        case _:
            return str(error)


def _parse(path: Path, text: str) -> YamlFile:
    name = str(path)
    tabs = tuple(Fault(name, line, what) for line, what in lines_indented_with_tabs(text))
    if tabs:
        return YamlFile(path, text, faults=tabs)
    reading = _Reading(name)
    try:
        root, second = composed(text)
        if second is not None:
            what = "a second document begins here ('---'). Write one document a file"
            reading.faults.append(Fault(name, second.start_mark.line + 1, what))
    except yaml.MarkedYAMLError as error:
        return YamlFile(path, text, faults=(Fault(name, *explain_syntax(error)),))
    except yaml.reader.ReaderError as error:
        return YamlFile(path, text, faults=(Fault(name, *explain_character(error, text)),))
    if root is None or root.tag == "tag:yaml.org,2002:null":
        what = "is empty. Write keys and values, for example 'rig: name'"
        return YamlFile(path, text, faults=(Fault(name, 1, what),))
    if not isinstance(root, yaml.MappingNode):
        what = "does not begin with a key. Write keys and values, for example 'rig: name'"
        return YamlFile(path, text, faults=(Fault(name, root.start_mark.line + 1, what),))
    reading.lines[()] = root.start_mark.line + 1
    data = reading.mapping(root, ())
    return YamlFile(path, text, data, reading.lines, tuple(reading.faults), frozenset(reading.unread))


class _Reading:
    """Turns nodes into plain data and notes lines and faults on the way."""

    def __init__(self, file: str) -> None:
        self._file = file
        self.lines: dict[KeyPath, int] = {}
        self.faults: list[Fault] = []
        self.unread: set[KeyPath] = set()

    def mapping(self, node: yaml.MappingNode, place: KeyPath) -> dict[str | int, Any]:
        data: dict[str | int, Any] = {}
        for key_node, value_node in node.value:
            line = key_node.start_mark.line + 1
            key = self._key(key_node, place, line)
            if key is None:
                continue
            here = (*place, key)
            if key in data:
                self._add(line, here, f"stands twice, first on line {self.lines[here]}. Remove one of the two")
                continue
            self.lines[here] = value_node.start_mark.line + 1 if isinstance(value_node, yaml.ScalarNode) else line
            data[key] = self._value(value_node, here)
        return data

    def _key(self, node: yaml.Node, place: KeyPath, line: int) -> str | int | None:
        try:
            key = _read_leaf(node) if isinstance(node, yaml.ScalarNode) else "a list or a group of keys"
        except ValueError as error:
            self._add(line, place, f"one of its keys cannot be read: {error}")
            return None
        if isinstance(node, yaml.ScalarNode) and (isinstance(key, str) or type(key) is int):
            return key
        self._add(line, place, f"one of its keys is {key}; allowed: words and whole numbers")
        return None

    def _value(self, node: yaml.Node, place: KeyPath) -> Any:
        if isinstance(node, yaml.MappingNode):
            return self.mapping(node, place)
        if isinstance(node, yaml.SequenceNode):
            return [self._item(item, (*place, number)) for number, item in enumerate(node.value)]
        try:
            return _read_leaf(node)
        except ValueError as error:
            self._add(self.lines[place], place, str(error))
            self.unread.add(place)
            return UNREAD

    def _add(self, line: int, place: KeyPath, what: str) -> None:
        self.faults.append(Fault(self._file, line, f"{named(place)}{what}"))

    def _item(self, node: yaml.Node, place: KeyPath) -> Any:
        self.lines[place] = node.start_mark.line + 1
        return self._value(node, place)


def _read_leaf(node: yaml.Node) -> Scalar:
    if node.tag == ALIAS:
        raise ValueError(f"is the alias {node.value}; aliases are not read. Write the value out in full")
    if node.tag == TAGGED:
        raise ValueError(f"has the tag {node.value}; tags are not read. Write the plain value")
    return read_scalar(node)
