"""Every error of the project, as one tree.

::

    GoniometerError
    ├── ConfigurationError (ValueError)      a recipe, rig or scene that cannot be used; lists every fault
    ├── DeviceError                          one device, named in every message
    │   ├── NotConnectedError (ConnectionError)   the port cannot be opened, or the link is gone
    │   ├── ReplyTimeoutError (TimeoutError)      no answer within the deadline
    │   ├── ReplyError (ValueError)               an answer that cannot be what was asked for
    │   ├── DeviceFaultError (RuntimeError)       the device itself reports a fault
    │   │   └── SaturatedError                        the detector gets more light than it takes
    │   ├── LimitError (ValueError)               a move outside the limits; refused before the first byte
    │   ├── CollisionError (ValueError)           a move whose path enters a collision zone; refused likewise
    │   └── PositionError (RuntimeError)          the device stopped somewhere else than it was sent
    ├── ReductionError (ValueError)          readings that cannot be turned into Stokes parameters
    ├── FitError (ValueError)                data that cannot determine the parameters asked for
    ├── JournalError (OSError)               a run's file cannot be written or read
    └── ScanInterrupted                      a person or the system asked the scan to stop

Each is also the builtin that it resembles, so ``except TimeoutError`` works without importing this module.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any


class GoniometerError(Exception):
    """Base of every error that the project raises on purpose."""


class ConfigurationError(GoniometerError, ValueError):
    """A recipe, rig or scene that cannot be used.

    Parameters
    ----------
    faults : sequence of str
        One line a fault, each with file and line, the value, what is allowed and what to do.
    """

    def __init__(self, faults: Sequence[str]) -> None:
        self.faults = tuple(faults)
        super().__init__("\n".join(self.faults))

    def __reduce__(self) -> tuple[Any, ...]:
        """Let it come whole out of another process."""
        return type(self), (self.faults,), self.__dict__


class DeviceError(GoniometerError):
    """Something went wrong with one device.

    Parameters
    ----------
    device : str
        The device's name in the rig file.
    happened : str
        What happened, with the value and the limit it met.
    not_done : str
        What was therefore not done.
    to_do : str
        What a person can do now.
    """

    def __init__(self, device: str, happened: str, *, not_done: str, to_do: str) -> None:
        self.device, self.happened, self.not_done, self.to_do = device, happened, not_done, to_do
        super().__init__(f"{device}: {happened}. Not done: {not_done}. What to do: {to_do}.")

    def __reduce__(self) -> tuple[Any, ...]:
        """Let it come whole out of another process."""
        return (
            partial(type(self), not_done=self.not_done, to_do=self.to_do),
            (self.device, self.happened),
            self.__dict__,
        )


class NotConnectedError(DeviceError, ConnectionError):
    """The port cannot be opened, or the link is gone."""


class ReplyTimeoutError(DeviceError, TimeoutError):
    """No answer within the deadline."""


class ReplyError(DeviceError, ValueError):
    """An answer that cannot be the answer to what was asked."""


class DeviceFaultError(DeviceError, RuntimeError):
    """The device itself reports a fault."""


class SaturatedError(DeviceFaultError):
    """The detector gets more light than it takes; the same reading may be well later."""


class LimitError(DeviceError, ValueError):
    """A move outside the limits, refused before the first byte was sent."""


class CollisionError(DeviceError, ValueError):
    """A move whose path enters a collision zone, refused before the first byte was sent."""


class PositionError(DeviceError, RuntimeError):
    """The device stopped somewhere else than it was sent."""


class ReductionError(GoniometerError, ValueError):
    """Readings that cannot be turned into Stokes parameters."""


class FitError(GoniometerError, ValueError):
    """Data that cannot determine the parameters asked for."""


class JournalError(GoniometerError, OSError):
    """A run's file cannot be written or read."""


class ScanInterrupted(GoniometerError):
    """A person or the system asked the scan to stop.

    Parameters
    ----------
    reason : str
        What asked, for example ``"Ctrl-C"``.
    exit_code : int
        The exit code a shell expects: 128 plus the signal's number.
    """

    def __init__(self, reason: str, exit_code: int) -> None:
        self.reason, self.exit_code = reason, exit_code
        super().__init__(reason)

    def __reduce__(self) -> tuple[Any, ...]:
        """Let it come whole out of another process."""
        return type(self), (self.reason, self.exit_code), self.__dict__
