"""What a scan decides as it goes, kept in its journal: one that is taken up again decides the same."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from typing import Any

_DECISION = "decision "
_TIME_LOST = "time lost "
"""How the keys of a journal's `about` begin under which stand decisions, and the time that interruptions have cost."""


class Decisions:
    """The decisions of a scan, each under the name of what it was about.

    Parameters
    ----------
    about : callable
        What the journal says of the scan; of a new one, nothing.
    remember : callable
        Stores a text under a key in the journal.
    """

    def __init__(
        self,
        about: Callable[[], Mapping[str, str]] = dict,
        remember: Callable[[str, str], None] = lambda key, text: None,
    ) -> None:
        self._about, self._remember = about, remember
        self._taken = {key.removeprefix(_DECISION): text for key, text in about().items() if key.startswith(_DECISION)}

    def of(self, what: str) -> dict[str, Any] | None:
        """What was decided earlier, None if nothing was."""
        text = self._taken.get(what)
        return None if text is None else dict(json.loads(text))

    def note(self, what: str, how: Mapping[str, Any]) -> None:
        """Keep a decision, before anything is done by it."""
        self._remember(_DECISION + what, json.dumps(how))

    def time_lost_s(self) -> float:
        """How much of the bench's time has gone between an interruption and its end, in all so far."""
        return sum(float(text) for key, text in self._about().items() if key.startswith(_TIME_LOST))


def time_lost_key(readings: int) -> str:
    """Under which the journal keeps the time lost after so many readings, once, however often it was begun again."""
    return f"{_TIME_LOST}after {readings} readings"


def without_decisions(about: Mapping[str, str]) -> dict[str, str]:
    """What a journal says of a scan, but for what only a scan that goes on needs."""
    return {key: text for key, text in about.items() if not key.startswith((_DECISION, _TIME_LOST))}
