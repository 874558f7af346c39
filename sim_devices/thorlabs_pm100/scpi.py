"""The command language of SCPI instruments: headers with short and long forms, paths, and the error queue."""

from __future__ import annotations

import itertools
import re
from collections import deque
from collections.abc import Iterator

_NODE = re.compile(r"\[:(\w+)\]|:?(\w+)")
_QUEUE_LENGTH = 10


_TEXTS = {
    -104: "Data type error",
    -108: "Parameter not allowed",
    -109: "Missing parameter",
    -113: "Undefined header",
    -200: "Execution error",
    -222: "Data out of range",
    -224: "Illegal parameter value",
    -230: "Data corrupt or stale",
    -241: "Hardware missing",
    -350: "Queue overflow",
    -363: "Input buffer overrun",
}


class ScpiError(Exception):
    """A command that is refused, with one of the standard's numbers."""

    def __init__(self, number: int) -> None:
        super().__init__(number, _TEXTS[number])
        self.number = number


def headers(pattern: str) -> Iterator[str]:
    """Every accepted spelling, in upper case, of a header such as ``MEASure[:SCALar][:POWer]?``."""
    pattern, query = pattern.removesuffix("?"), "?" * pattern.endswith("?")
    if pattern.startswith("*"):
        yield pattern + query
        return
    choices = []
    for optional, required in _NODE.findall(pattern):
        name = optional or required
        short = "".join(letter for letter in name if not letter.islower())
        choices.append({short, name.upper()} | ({""} if optional else set()))
    for nodes in itertools.product(*choices):
        yield ":".join(filter(None, nodes)) + query


def commands(line: str) -> Iterator[tuple[str, list[str]]]:
    """Header, in upper case from the root, and arguments of every command of a line.

    After a semicolon a header continues where the last one was, unless it begins with a colon.
    """
    path = ""
    for command in filter(None, (part.strip() for part in line.split(";"))):
        header, _, rest = command.partition(" ")
        header = header.upper()
        if not header.startswith("*"):
            header = header[1:] if header.startswith(":") else path + header
            path = header[: header.rfind(":") + 1]
        yield header, [argument.strip() for argument in rest.split(",")] if rest.strip() else []


class ErrorQueue:
    """The errors of an instrument, oldest first; the last place tells that some were lost."""

    def __init__(self) -> None:
        self._errors: deque[int] = deque()

    def __len__(self) -> int:
        return len(self._errors)

    def add(self, number: int) -> None:
        """Queue an error."""
        if len(self._errors) == _QUEUE_LENGTH:
            self._errors[-1] = -350
        else:
            self._errors.append(number)

    def next(self) -> str:
        """Take the oldest error, as the instrument prints it."""
        if not self._errors:
            return '0,"No error"'
        number = self._errors.popleft()
        return f'{number},"{_TEXTS[number]}"'

    def clear(self) -> None:
        """Forget all errors."""
        self._errors.clear()
