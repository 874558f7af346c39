"""Messages about one input of many, for the cell of a table whose row names it already."""

from __future__ import annotations

import re
from pathlib import Path

_SHOWN = 2
_KNOWN = re.compile(r"\s*\b(Nothing was (fitted|read|done)|No result is given)\.")


def in_a_cell(message: str, path: Path) -> str:
    """A message in one line, with its first faults, less what its row says: which input, and that it was not fitted."""
    name = re.escape(str(path))
    text = re.sub(rf"^{name} was not used\..*", "", message, flags=re.MULTILINE)
    text = _KNOWN.sub("", text)
    text = re.sub(rf"^{name}:(?=\d+:)", "line ", text, flags=re.MULTILINE)
    text = re.sub(rf"^{name}[:/\\]?\s*", "", text, flags=re.MULTILINE)
    faults = [" ".join(line.split()) for line in text.splitlines() if line.strip()]
    more = len(faults) - _SHOWN
    return "; ".join([*faults[:_SHOWN], *([f"and {more} more faults"] if more > 0 else [])])
