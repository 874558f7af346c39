"""Messages of the control connection: one JSON value a line."""

from __future__ import annotations

import json
from typing import Any


def printed(message: dict[str, Any]) -> bytes:
    """A message as a line."""
    return json.dumps(message).encode() + b"\n"


def parsed(line: bytes) -> Any:
    """What a line holds; None when it is no JSON."""
    try:
        return json.loads(line)
    except (ValueError, RecursionError):  # brackets within brackets within brackets
        return None
