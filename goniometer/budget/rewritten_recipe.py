"""A recipe's text with other exit angles and readings, and all else as its author wrote it."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path

import yaml

from acquisition.recipe import Recipe
from goniometer.errors import ConfigurationError

_FILES = ("rig", "scene")


def rewritten_recipe(text: str, recipe: Recipe, comments: Sequence[str]) -> str:
    """The text of a valid recipe with the exit angles and readings of another one, and comments at its top."""
    angles = f"exit_deg: [{', '.join(f'{angle:.10g}' for angle in recipe.exit_angles_deg())}]"
    readings = f"readings: [{', '.join(map(str, recipe.readings_of_angles()))}]"
    text = _replaced(text, {"exit": angles, "exit_deg": angles, "readings": readings})
    return "".join(f"# {line}".rstrip() + "\n" for line in comments) + text


def moved(text: str, start: Path, end: Path) -> str:
    """The text of a recipe that is written to another folder: its files are named from there."""
    if start.resolve() == end.resolve():
        return text
    named = yaml.safe_load(text)
    return _replaced(
        text,
        {
            key: f"{key}: {json.dumps(_from_folder(end, start / named[key]), ensure_ascii=False)}"
            for key in _FILES
            if key in named
        },
    )


def write_new(path: Path, text: str) -> None:
    """Write a file that is not there yet.

    Raises
    ------
    ConfigurationError
        When there is one, or it cannot be written.
    """
    try:
        with path.open("x", encoding="utf-8") as stream:
            stream.write(text)
    except FileExistsError:
        raise ConfigurationError([f"{path} exists already, and was left as it is. Choose another name."]) from None
    except OSError as error:
        raise ConfigurationError([f"{path} cannot be written: {error.strerror}. Choose another name."]) from error


def _replaced(text: str, lines: Mapping[str, str]) -> str:
    """Put other text in the place of keys at the top and of their values; comments beside them stay."""
    root = yaml.compose(text, Loader=yaml.SafeLoader)
    assert isinstance(root, yaml.MappingNode), "a recipe that was accepted begins with a key"
    for key, value in reversed(root.value):
        if key.value in lines:
            text = text[: key.start_mark.index] + lines[key.value] + text[_end(value) :]
    return text


def _end(node: yaml.Node) -> int:
    """Where a value ends; that of a block is said to end where the next key begins, behind its comments."""
    children = []
    if isinstance(node, yaml.CollectionNode) and not node.flow_style:
        children = [child for entry in node.value for child in (entry if isinstance(entry, tuple) else (entry,))]
    end: int = max([_end(child) for child in children], default=node.end_mark.index)
    return end


def _from_folder(folder: Path, file: Path) -> str:
    try:
        return Path(os.path.relpath(file.resolve(), folder.resolve())).as_posix()
    except ValueError:  # on another drive
        return str(file.resolve())
