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
        self._off_until_s = [float("-inf")] * len(self._members)

    def session(self) -> _Session:
        """A new client."""
        return _Session([member.session() for member in self._members], self._off_until_s)

    def turn_off(self, member: object, until_s: float) -> None:
        """Let one of its members hear and say nothing until then."""
        self._off_until_s[self._members.index(member)] = until_s


class _Session:
    def __init__(self, sessions: Sequence[Session], off_until_s: Sequence[float]) -> None:
        self._sessions, self._off_until_s = sessions, off_until_s

    def receive(self, data: bytes, now_s: float) -> list[Due]:
        """Let everyone hear it who is on; what they say, in the order of its times."""
        members = zip(self._sessions, self._off_until_s, strict=True)
        due = [reply for session, off_s in members if now_s >= off_s for reply in session.receive(data, now_s)]
        return sorted(due, key=lambda reply: reply[0])
