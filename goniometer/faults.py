"""Turns what a model refuses into lines a person can act on: file, line, value, what is allowed, nearest known key."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterator
from typing import Any, NamedTuple

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from goniometer.schema import Kind, Node, allowed, child, chosen, known_keys, schema
from goniometer.yaml_file import Fault, KeyPath, YamlFile

_UNIT_WORDS = {
    "deg": "degrees",
    "deg_s": "degrees per second",
    "deg_s2": "degrees per second squared",
    "nm": "nanometres",
    "s": "seconds",
    "w": "watts",
    "sr": "steradians",
}
_UNIT = re.compile(
    r"_(deg_s2|deg_s|deg|rad_s2|rad_s|rad|mrad|arcmin|arcsec"
    r"|pm|nm|um|mm|m|ns|us|ms|s|min|h|pw|nw|uw|mw|w|kw|usr|msr|sr)$"
)
"""The unit at the end of a key, be it one that these files use or one that a person may try."""


class _Refusal(NamedTuple):
    """One of pydantic's errors, with its place in the file and the schema of that place."""

    error: ErrorDetails
    place: KeyPath
    node: Node
    parent: Node
    value: Any


def model_faults(error: ValidationError, file: YamlFile, kind: Kind) -> Iterator[Fault]:
    """Say each thing that a model refuses once, at its place in the file.

    Parameters
    ----------
    error : pydantic.ValidationError
        As raised when `file.data` was validated.
    file : YamlFile
        The file; places that could not be read already have their fault and get no second one.
    kind : "recipe", "rig" or another kind of file
        Which schema says what is allowed.
    """
    root = schema(kind)
    refusals = [_locate(details, file, root) for details in error.errors(include_url=False)]
    meant = {_meant_place(refusal) for refusal in refusals if _is_about_a_key(refusal.error)}
    said = set(file.unread)
    # The deepest first: a list with a bad item is also, to pydantic, a list that is too short. A grid with a bad end is
    # also neither a number nor a list.
    for refusal in sorted(refusals, key=lambda refusal: (-len(refusal.place), refusal.error["type"] != "faults")):
        depth = len(refusal.place)
        is_said = depth > 0 and any(place[:depth] == refusal.place for place in said)
        is_written_otherwise = refusal.error["type"] == "missing" and refusal.place in meant
        if not is_said and not is_written_otherwise:
            said.add(refusal.place)
            yield from _words(refusal, file, root)


def _locate(error: ErrorDetails, file: YamlFile, root: Node) -> _Refusal:
    """Follow pydantic's location, which also names union members, through the file and the schema."""
    value: Any = file.data
    place: KeyPath = ()
    node = parent = root
    for step in error["loc"]:
        if (member := chosen(root, node, step)) is not node:
            node = member
            continue
        is_held = (isinstance(value, dict) and step in value) or (isinstance(value, list) and step in range(len(value)))
        is_missing = error["type"] == "missing" and isinstance(value, dict) and step == error["loc"][-1]
        if is_held or is_missing:
            place, parent, node = (*place, step), node, child(root, node, step)
            value = value[step] if is_held else None
    if error["type"].startswith("union_tag"):
        key = error["ctx"]["discriminator"].strip("'")
        place, parent = (*place, key), node
        node = {"enum": list(node["discriminator"]["mapping"])}
        value = value.get(key) if isinstance(value, dict) else None
    return _Refusal(error, place, node, parent, value)


def _words(refusal: _Refusal, file: YamlFile, root: Node) -> Iterator[Fault]:
    error, place = refusal.error, refusal.place
    context = error.get("ctx", {})
    if error["type"] == "faults":
        for below, what in context["faults"]:
            yield file.fault((*place, *below), what)
    elif _is_about_a_key(error):
        yield file.fault(place, _unknown_key(str(place[-1]), refusal.parent))
    elif error["type"] in ("missing", "union_tag_not_found") and refusal.value is None:
        meaning = refusal.node.get("description", allowed(root, refusal.node))
        yield file.fault(place, f"is missing. Add it: {meaning}")
    elif error["type"] == "value_error":
        yield file.fault(place, str(context["error"]))
    else:
        yield file.fault(place, f"got {shown(refusal.value)}; allowed: {allowed(root, refusal.node)}{_hint(refusal)}")


def _is_about_a_key(error: ErrorDetails) -> bool:
    return error["type"] in ("extra_forbidden", "invalid_key") or error["loc"][-1:] == ("[key]",)


def shown(value: Any) -> str:
    """A value as a person wrote it, cut to a readable length."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, dict):
        return f"a group of keys: {', '.join(map(str, value))}" if value else "an empty group {}"
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def _hint(refusal: _Refusal) -> str:
    is_number = refusal.node.get("type") in ("number", "integer")
    if is_number and isinstance(refusal.value, str) and re.match(r"[-+.]?\d", refusal.value):
        return ". Write the number alone, without quotes or unit"
    return ""


def _unknown_key(key: str, parent: Node) -> str:
    known = known_keys(parent)
    meant, unit = _nearest_key(key, known)
    if meant and unit:
        return f"is not a key here; the unit is {unit}: write {meant!r}"
    if meant:
        return f"is not a key here; did you mean {meant!r}?"
    if known:
        return f"is not a key here; allowed: {', '.join(known)}"
    return f"is not a key here; allowed: {parent.get('description', 'other keys')}"


def _meant_place(refusal: _Refusal) -> KeyPath:
    *above, key = refusal.place
    meant, _ = _nearest_key(str(key), known_keys(refusal.parent))
    return (*above, meant)


def _nearest_key(key: str, known: list[str]) -> tuple[str, str]:
    """The known key that was probably meant, and its unit when the unit is what is wrong; empty when none is near."""
    key = key.lower()
    if key in known:
        return key, ""
    for candidate in known:
        unit = _UNIT.search(candidate)
        if unit and _UNIT.sub("", candidate) == _UNIT.sub("", key):
            return candidate, _UNIT_WORDS.get(unit[1], unit[1])
    near = difflib.get_close_matches(key, known, n=1)
    return (near[0] if near else ""), ""
