"""Several devices on one multi-drop line."""

from __future__ import annotations

from collections.abc import Sequence

from sim_devices.device import Device, Due, Session


class SharedLine:
    """A line on which every member hears every byte, and a client hears them all.

    Parameters
    ----------
    members : sequence of Device
        Devices that answer to addresses of their own.
    """

    def __init__(self, members: Sequence[Device]) -> None:
        self._members = tuple(members)

    def session(self) -> _Session:
        """A new client."""
        return _Session([member.session() for member in self._members])


class _Session:
    def __init__(self, sessions: Sequence[Session]) -> None:
        self._sessions = sessions

    def receive(self, data: bytes, now_s: float) -> list[Due]:
        """Let everyone hear it; what they say, in the order of its times."""
        due = [reply for session in self._sessions for reply in session.receive(data, now_s)]
        return sorted(due, key=lambda reply: reply[0])
