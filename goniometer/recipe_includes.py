"""A recipe with all that it includes: presets, other files' keys, and a table of directions beside it."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from goniometer.recipe_table import with_table
from goniometer.whole_recipe import WholeRecipe, texts_of_keys
from goniometer.yaml_file import UNREAD, Fault, KeyPath, YamlFile, read_yaml

PRESETS = Path(__file__).parent / "presets"

_MOST_FILES = 50
_PRESET_NAME = re.compile(r"[a-z0-9_]+")
_FILES = ("rig", "scene", "points_file")
_LISTED = {"points", "points_file"}
_PRODUCT = {"incidence_deg", "exit", "exit_deg", "azimuth_deg", "exit_azimuth_deg"}
_INSTEAD: dict[str | int, set[str]] = {
    "exit": {"exit_deg"},
    "exit_deg": {"exit"},
    "points": {"points_file"},
    "points_file": {"points"},
}
"""Keys that say the same thing in another way: those that a file writes replace the included ones."""


@dataclass(frozen=True)
class _Written:
    """A key's value, its lines in the file that holds it, and that file."""

    value: Any
    text: str
    file: YamlFile


def preset_names() -> tuple[str, ...]:
    """The presets that come with the program."""
    return tuple(sorted(path.stem for path in PRESETS.glob("*.yaml")))


def whole_recipe(file: YamlFile) -> YamlFile:
    """A recipe with all that it includes, its text likewise; one that includes nothing is returned as it is.

    Keys are merged at the top of the files: a file's own keys replace those that it includes, each as a whole. Two
    included files that contradict each other in a key are a fault unless the file that includes them writes it itself.
    Files are found from the folder of the file that names them.
    """
    if file.data is None or not {"include", "points_file"} & file.data.keys():
        return file
    reading = _Including(file.path.parent)
    written = reading.keys_of(file, (file.path.resolve(),))
    data = {key: one.value for key, one in written.items()}
    text = _merged_text(file, written)
    unread = frozenset(place for key, one in written.items() for place in one.file.unread if place[0] == key)
    whole = WholeRecipe(
        file.path,
        text,
        data,
        file.lines,
        (*file.faults, *reading.faults),
        unread,
        {k: w.file for k, w in written.items()},
    )
    return with_table(whole) if "points_file" in data else whole


class _Including:
    """Reads included files, and collects what is wrong with them."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._files = 0
        self.faults: list[Fault] = []

    def keys_of(self, file: YamlFile, chain: tuple[Path, ...]) -> dict[str | int, _Written]:
        """The keys of a file and of all that it includes; `chain` are the files that led to it, itself the last."""
        assert file.data is not None, "a file that could not be read is not looked into"
        own = self._own_keys(file)
        replaced = own.keys() | {other for key in own for other in _INSTEAD.get(key, ())}
        for one, other in ((_LISTED, _PRODUCT), (_PRODUCT, _LISTED)):
            replaced |= other if own.keys() & one else set()
        included: dict[str | int, _Written] = {}
        for place, name in self._names(file):
            for key, written in self._included(file, place, name, chain).items():
                first = included.setdefault(key, written)
                if key not in replaced and first.value != written.value:
                    here, there = (_place(one, key) for one in (first, written))
                    self.faults.append(
                        file.fault(
                            place, f"{key!r} is one thing at {here} and another at {there}. Write it in this file"
                        )
                    )
        return {**{key: one for key, one in included.items() if key not in replaced}, **own}

    def _own_keys(self, file: YamlFile) -> dict[str | int, _Written]:
        texts = texts_of_keys(file)
        own = {}
        for key, value in (file.data or {}).items():
            if key == "include":
                continue
            text = texts.get(key, "")
            if key in _FILES and isinstance(value, str) and value and file.path.parent != self._folder:
                value = _from_folder(self._folder, file.path.parent / value)
                text = yaml.safe_dump({key: value}, allow_unicode=True)
            own[key] = _Written(value, text, file)
        return own

    def _names(self, file: YamlFile) -> Iterator[tuple[KeyPath, str]]:
        names = (file.data or {}).get("include", [])
        single = not isinstance(names, list)
        for number, name in enumerate([names] if single else names):
            place: KeyPath = ("include",) if single else ("include", number)
            if isinstance(name, str) and name and "\0" not in name:
                yield place, name
            elif name is not UNREAD:
                what = (
                    f"got {name!r}; allowed: the name of a preset ({', '.join(preset_names())}) or of a file, or a list"
                )
                self.faults.append(file.fault(place, what))

    def _included(
        self, file: YamlFile, place: KeyPath, name: str, chain: tuple[Path, ...]
    ) -> dict[str | int, _Written]:
        if _PRESET_NAME.fullmatch(name):
            path = PRESETS / f"{name}.yaml"
            if name not in preset_names():
                known = ", ".join(preset_names())
                what = f"there is no preset {name!r}; allowed: {known}, or the name of a file, such as {name}.yaml"
                self.faults.append(file.fault(place, what))
                return {}
        else:
            path = Path(os.path.normpath(file.path.parent / name))
        resolved = path.resolve()
        self._files += 1
        if resolved in chain:
            round_about = " includes ".join(one.name for one in (*chain[chain.index(resolved) :], resolved))
            self.faults.append(file.fault(place, f"includes itself: {round_about}. Take one of these out"))
            return {}
        if self._files > _MOST_FILES:
            self.faults.append(
                file.fault(place, f"is included file number {self._files}; allowed: at most {_MOST_FILES}")
            )
            return {}
        included = read_yaml(path)
        for fault in included.faults:
            self.faults.append(file.fault(place, f"{path} {fault.text}") if fault.line is None else fault)
        return {} if included.data is None else self.keys_of(included, (*chain, resolved))


def _place(written: _Written, key: str | int) -> str:
    return f"{written.file.path}:{written.file.lines[(key,)]}"


def _merged_text(file: YamlFile, written: Mapping[str | int, _Written]) -> str:
    """The recipe's own lines without what it includes, and then those of the included files, each under its name."""
    written = {key: one for key, one in written.items() if key != "points_file"}  # the table itself follows
    own = [one.text for one in written.values() if one.file is file]
    head = file.text.splitlines(keepends=True)[: file.lines[()] - 1] if file.text[:1] == "#" else []
    parts = ["".join(head), *own]
    files = {id(one.file): one.file for one in written.values() if one.file is not file}
    for number, included in files.items():
        parts.append(f"# from {included.path.name}\n")
        parts += [one.text for one in written.values() if id(one.file) == number]
    return "".join(part if part.endswith("\n") or not part else f"{part}\n" for part in parts)


def _from_folder(folder: Path, file: Path) -> str:
    """How a file is named from a folder."""
    try:
        return Path(os.path.relpath(file.resolve(), folder.resolve())).as_posix()
    except ValueError:  # on another drive
        return str(file.resolve())
