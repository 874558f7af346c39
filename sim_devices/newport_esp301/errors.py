"""The errors of an ESP301, and the queue in which they wait to be asked for."""

from __future__ import annotations

from collections import deque

_LENGTH = 10
_GENERAL = {
    0: "NO ERROR DETECTED",
    4: "EMERGENCY STOP ACTIVATED",
    6: "COMMAND DOES NOT EXIST",
    7: "PARAMETER OUT OF RANGE",
    9: "AXIS NUMBER OUT OF RANGE",
    37: "AXIS NUMBER MISSING",
    38: "COMMAND PARAMETER MISSING",
    40: "LAST COMMAND CANNOT BE REPEATED",
}
_OF_AXIS = {
    0: "MOTOR TYPE NOT DEFINED",
    1: "PARAMETER OUT OF RANGE",
    2: "AMPLIFIER FAULT",
    3: "FOLLOWING ERROR THRESHOLD EXCEEDED",
    4: "POSITIVE HARDWARE LIMIT DETECTED",
    5: "NEGATIVE HARDWARE LIMIT DETECTED",
    6: "POSITIVE SOFTWARE LIMIT DETECTED",
    7: "NEGATIVE SOFTWARE LIMIT DETECTED",
    8: "MOTOR / STAGE NOT CONNECTED",
    9: "FEEDBACK SIGNAL FAULT",
    10: "MAXIMUM VELOCITY EXCEEDED",
    11: "MAXIMUM ACCELERATION EXCEEDED",
    13: "MOTOR NOT ENABLED",
    15: "MAXIMUM JERK EXCEEDED",
    20: "HOMING ABORTED",
    24: "SPEED OUT OF RANGE",
    30: "COMMAND NOT ALLOWED DURING HOMING",
}


class Esp301Errors:
    """The newest ten errors, oldest first, each with its time.

    Parameters
    ----------
    tick_s : float
        In which times are counted.
    """

    def __init__(self, tick_s: float) -> None:
        self._tick_s = tick_s
        self._queue: deque[tuple[int, float]] = deque(maxlen=_LENGTH)

    def add(self, code: int, time_s: float) -> None:
        """Queue an error: 0 to 99, or that of an axis, which counts from its hundred."""
        self._queue.append((code, time_s))

    def clear(self) -> None:
        """Forget them all."""
        self._queue.clear()

    def next_number(self, now_s: float) -> str:
        """Take the oldest as its number."""
        return str(self._next(now_s)[0])

    def next_text(self, now_s: float) -> str:
        """Take the oldest as number, time and text."""
        code, time_s = self._next(now_s)
        text = _GENERAL[code] if code < 100 else _OF_AXIS[code % 100]
        return f"{code}, {int(time_s / self._tick_s)}, {text}"

    def _next(self, now_s: float) -> tuple[int, float]:
        return self._queue.popleft() if self._queue else (0, now_s)
