"""The JSON Schema of a user's files: printed for editors, and asked for what is allowed at a place of a file."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import BaseModel

from acquisition.calibrated_slots import SlotCalibration
from acquisition.calibration_recipe import CalibrationRecipe
from acquisition.recipe import Recipe
from goniometer.rig_file import Rig
from sim_devices.scene import Scene

Kind = Literal["recipe", "rig", "scene", "calibration-recipe", "calibration"]
Node = dict[str, Any]

MODELS: dict[Kind, type[BaseModel]] = {
    "recipe": Recipe,
    "rig": Rig,
    "scene": Scene,
    "calibration-recipe": CalibrationRecipe,
    "calibration": SlotCalibration,
}


_NAME: Node = {"type": "string", "minLength": 1}
_INCLUDE: Node = {
    "description": "presets (goniometer presets) and files whose keys are taken over where this file has none",
    "anyOf": [_NAME, {"type": "array", "items": _NAME}],
}
"""No key of a recipe itself: what it names is merged before the recipe is checked."""


def schema(kind: Kind) -> Node:
    """JSON Schema of a recipe, a rig or another kind of file, for editors that complete and check YAML.

    Parameters
    ----------
    kind : "recipe", "rig", "scene", "calibration-recipe" or "calibration"
        Which file.
    """
    node: Node = _without_null(MODELS[kind].model_json_schema())
    if kind == "recipe":
        node["properties"]["include"] = _INCLUDE
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **node}


def _without_null(node: Any) -> Any:
    """Drop the null of optional keys: in a file, a key that is not wanted is left out."""
    if isinstance(node, list):
        return [_without_null(item) for item in node]
    if not isinstance(node, dict):
        return node
    node = {key: _without_null(value) for key, value in node.items() if not (key == "default" and value is None)}
    options = node.get("anyOf", [])
    if {"type": "null"} in options:
        options = [option for option in options if option != {"type": "null"}]
        del node["anyOf"]
        node = {**(options[0] if len(options) == 1 else {"anyOf": options}), **node}
    return node


def resolved(root: Node, node: Node) -> Node:
    """A node with its ``$ref`` followed; descriptions beside the reference win."""
    while "$ref" in node:
        target = root["$defs"][node["$ref"].rpartition("/")[2]]
        node = {**target, **{key: value for key, value in node.items() if key != "$ref"}}
    return node


def chosen(root: Node, node: Node, option: Any) -> Node:
    """The member of a discriminated union that `option` names; other nodes are returned as they are."""
    reference = node.get("discriminator", {}).get("mapping", {}).get(option)
    if not reference and {"$ref": f"#/$defs/{option}"} in node.get("oneOf", []):
        reference = f"#/$defs/{option}"
    return resolved(root, {"$ref": reference}) if reference else node


def child(root: Node, node: Node, key: str | int) -> Node:
    """The node of a key or a list's item; empty when the schema knows none."""
    if key in node.get("properties", {}):
        return resolved(root, node["properties"][key])
    if isinstance(key, int) and 0 <= key < len(node.get("prefixItems", [])):
        return resolved(root, node["prefixItems"][key])
    for others in ("additionalProperties", "items"):
        if isinstance(node.get(others), dict):
            return resolved(root, node[others])
    options = (child(root, resolved(root, option), key) for option in node.get("anyOf", []))
    return next(filter(None, options), {})


def known_keys(node: Node) -> list[str]:
    """The keys that a mapping may have; empty when it may have any."""
    return list(node.get("properties") or node.get("propertyNames", {}).get("enum", []))


def allowed(root: Node, node: Node) -> str:
    """What may stand at a node, in words."""
    node = resolved(root, node)
    if "discriminator" in node:
        return f"a group of keys, one of them {node['discriminator']['propertyName']}"
    if options := node.get("anyOf") or node.get("oneOf"):
        return ", or ".join(allowed(root, option) for option in options)
    if "const" in node:
        return str(node["const"])
    if "enum" in node:
        return _either(node["enum"])
    match node.get("type"):
        case "number":
            return f"a number{_range(node)}"
        case "integer":
            return f"a whole number{_range(node)}"
        case "boolean":
            return "true or false"
        case "string":
            return "text that is not empty" if node.get("minLength") else "text"
        case "array":
            return _list(root, node)
        case "object":
            keys = known_keys(node)
            return f"a group of keys: {', '.join(keys)}" if keys else "a group of keys"
        case _:
            return "something else"


def _either(words: list[Any]) -> str:
    return " or ".join(filter(None, (", ".join(map(str, words[:-1])), str(words[-1]))))


def _range(node: Node) -> str:
    low, high = node.get("minimum"), node.get("maximum")
    if low is not None and high is not None:
        return f" from {low:.10g} to {high:.10g}"
    bounds = (
        (low, "at least"),
        (node.get("exclusiveMinimum"), "greater than"),
        (high, "at most"),
        (node.get("exclusiveMaximum"), "less than"),
    )
    words = [f"{words} {bound:.10g}" for bound, words in bounds if bound is not None]
    return f" {' and '.join(words)}" if words else ""


def _list(root: Node, node: Node) -> str:
    low, high = node.get("minItems", 0), node.get("maxItems")
    items = [allowed(root, item) for item in node.get("prefixItems") or [node.get("items", {})]]
    count = f"{low} " if low == high else f"at least {low} " if low else ""
    each = f"each {items[0]}" if len(set(items)) == 1 else ", then ".join(items)
    return f"a list of {count}value{'s' * (low != 1)}, {each}"
