"""What a person is told when a port fails."""

from __future__ import annotations

from goniometer.errors import NotConnectedError, ReplyError, ReplyTimeoutError

_WRONG_PORT = "check that the port belongs to this device and that the baud rates agree"


def cannot_open(device: str, port: str, reason: Exception) -> NotConnectedError:
    """Describe a port that does not open."""
    return NotConnectedError(
        device,
        f"port {port} cannot be opened ({reason})",
        not_done="nothing was sent to the device",
        to_do="check power and cable, close other programs that use the port, and compare the port in the rig file "
        "with the ports of this computer",
    )


def lost(device: str, port: str, reason: Exception) -> NotConnectedError:
    """Describe a port that was open and is gone."""
    return NotConnectedError(
        device,
        f"the link on port {port} is gone ({reason})",
        not_done="the exchange was given up; the device may still carry out its last command",
        to_do="look at the device first, then check power and cable and start again",
    )


def not_taken(device: str, port: str, data: bytes, limit_s: float) -> ReplyTimeoutError:
    """Describe bytes that the other end does not accept."""
    return ReplyTimeoutError(
        device,
        f"it did not take {data!r} on port {port} within {limit_s:g} s",
        not_done="the command may have been sent in part",
        to_do="check that the device is on and that its handshake lines are wired",
    )


def unanswered(device: str, port: str, asked: bytes, limit_s: float, received: bytes) -> ReplyTimeoutError:
    """Describe an answer that did not come, or not whole."""
    return ReplyTimeoutError(
        device,
        f"no complete answer to {asked!r} on port {port} within {limit_s:g} s (received so far: {received!r})",
        not_done="the exchange was given up",
        to_do="check that the device is on, that the cable sits and that the baud rates agree",
    )


def endless(device: str, port: str, longest: int, beginning: bytes) -> ReplyError:
    """Describe output that has no end within `longest` bytes."""
    return ReplyError(
        device,
        f"more than {longest} bytes without an end came on port {port} (beginning {beginning!r})",
        not_done="the answer was thrown away",
        to_do=_WRONG_PORT,
    )


def restless(device: str, port: str, sample: bytes) -> ReplyError:
    """Describe a port on which bytes come without a pause."""
    return ReplyError(
        device,
        f"bytes come on port {port} without a pause (such as {sample!r})",
        not_done="nothing was sent to the device",
        to_do=_WRONG_PORT,
    )
