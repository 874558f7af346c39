"""What a single YAML value means, without the surprises of YAML 1.1.

YAML 1.1 reads `on` as true, `12:30` as 750 and `010` as 8, and leaves `1e-3` as text. None of these is what a person
meant, so each is refused with what to write instead.
"""

from __future__ import annotations

import math
import re

import yaml

Scalar = bool | int | float | str

_INTEGER = re.compile(r"[-+]?(0|[1-9][0-9]{0,17})")
_FLOAT = re.compile(r"[-+]?([0-9]+\.[0-9]*|\.[0-9]+)([eE][-+][0-9]+)?")
_EXPONENT = re.compile(r"([-+]?[0-9]+)(\.[0-9]*)?[eE]([-+]?)([0-9]+)")
_DECIMAL_COMMA = re.compile(r"([-+]?[0-9]+),([0-9]+)")
_HALF_CHARACTER = re.compile("[\ud800-\udfff]")
_TAG = "tag:yaml.org,2002:"


def read_scalar(node: yaml.Node) -> Scalar:
    """Read a scalar; text in quotes is always text.

    Parameters
    ----------
    node : yaml.Node
        A scalar, as composed by PyYAML's safe loader, with its resolved tag.

    Raises
    ------
    ValueError
        When YAML would read it as something a person did not mean; the message says what to write.
    """
    text = node.value
    if _HALF_CHARACTER.search(text):
        raise ValueError(f"got {text!r}, which is not text: \\ud800 to \\udfff are halves of characters")
    match node.tag.removeprefix(_TAG):
        case "str":
            return _plain_text(text) if getattr(node, "style", None) is None else text
        case "int":
            return _integer(text)
        case "float":
            return _float(text)
        case "bool":
            return _boolean(text)
        case "null":
            raise ValueError("has no value. Write one after the colon, or leave the key out")
        case "timestamp":
            raise ValueError(f"got {text}, which YAML reads as a date. Put it in quotes if it is text: '{text}'")
        case "merge":
            raise ValueError("got <<, which merges other keys in; these are not read. Write the keys out in full")
        case _:
            raise ValueError(
                f"got {text}, which has a special meaning in YAML. Put it in quotes if it is text: '{text}'"
            )


def _plain_text(text: str) -> str:
    if comma := _DECIMAL_COMMA.fullmatch(text):
        raise ValueError(f"got {text}, a number with a comma. Write it with a point: {comma[1]}.{comma[2]}")
    try:
        number = float(text)
    except ValueError:
        return text
    if not math.isfinite(number):
        raise ValueError(f"got {_shortened(text)}, which is no finite number. Write a number, or put text in quotes")
    raise ValueError(
        f"got {_shortened(text)}, which YAML reads as text, not as a number. Write {_as_yaml_number(text, number)}"
    )


def _as_yaml_number(text: str, number: float) -> str:
    if parts := _EXPONENT.fullmatch(text):
        mantissa, fraction, sign, exponent = parts.groups()
        return f"{mantissa}{fraction or '.0'}e{sign or '+'}{exponent}"
    return f"{number:.15g}"


def _integer(text: str) -> int:
    if _INTEGER.fullmatch(text):
        return int(text)
    if ":" in text:
        raise ValueError(f"got {text}, which YAML reads as {_base_60(text)} (base 60). {_number_or_quotes(text)}")
    if re.fullmatch(r"[-+]?0[0-7_]+", text):
        raise ValueError(
            f"got {_shortened(text)}, which YAML reads as an octal number. Write it without the leading zero, or put "
            "it in quotes if it is text"
        )
    raise ValueError(
        f"got {_shortened(text)}; allowed: a whole number of at most 18 decimal digits, not '_', hexadecimal or binary"
    )


def _float(text: str) -> float:
    if ":" in text:
        raise ValueError(f"got {text}, which YAML reads in base 60. {_number_or_quotes(text)}")
    if "_" in text:
        raise ValueError(f"got {_shortened(text)}. Write the number without '_'")
    if not _FLOAT.fullmatch(text) or not math.isfinite(float(text)):
        raise ValueError(f"got {_shortened(text)}, which is no finite number. Write a finite number")
    return float(text)


def _boolean(text: str) -> bool:
    meaning = text.lower() in ("true", "yes", "on")
    if text.lower() not in ("true", "false"):
        raise ValueError(
            f"got {text}, which YAML reads as {str(meaning).lower()}. Write true or false, or put it in quotes if it "
            f"is text: '{text}'"
        )
    return meaning


def _base_60(text: str) -> int:
    value = 0
    for digits in text.lstrip("-+").replace("_", "").split(":"):
        value = 60 * value + int(digits)
    return value


def _number_or_quotes(text: str) -> str:
    return f"Write the number in decimal, or put it in quotes if it is text: '{text}'"


def _shortened(text: str) -> str:
    return text if len(text) <= 40 else f"{text[:37]}..."
