"""Values as JSON holds them."""

from __future__ import annotations

import math
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from acquisition.fit_points import in_degrees
from model.fit import FitResult


def plain(value: Any) -> Any:
    """Turn a value into what `json` writes: numbers that JSON cannot hold become null, arrays lists, a fit an object.

    Raises
    ------
    TypeError
        If it is of a kind that has no form in JSON.
    """
    match value:
        case None | bool() | str() | int():
            return value
        case float() | np.floating():
            return float(value) if math.isfinite(value) else None
        case np.generic() | np.ndarray():
            return plain(value.tolist())
        case dict():
            return {str(key): plain(entry) for key, entry in value.items()}
        case list() | tuple():
            return [plain(entry) for entry in value]
    if isinstance(value, FitResult):
        return plain(in_degrees(value).to_dict())
    if is_dataclass(value):
        return {field.name: plain(getattr(value, field.name)) for field in fields(value)}
    raise TypeError(f"a {type(value).__name__} has no form in JSON yet")
