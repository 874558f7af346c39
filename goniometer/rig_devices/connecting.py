"""A bench that is being connected, device by device."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field
from typing import Any, Protocol, TypeVar

from acquisition.protocols import Analyzer, Detector, RotaryAxis
from drivers.clock import Clock


class Closable(Protocol):
    """What is closed when the bench is left."""

    def close(self) -> None:
        """Close the port."""
        ...


T = TypeVar("T", bound=Closable)


@dataclass
class Connecting:
    """What has been connected so far.

    Parameters
    ----------
    ports : mapping of str to str
        The port of each device, by the device's name.
    clock : Clock
        The bench's clock.
    wavelength_nm : float
        Told to detectors whose response depends on it.
    open_devices : ExitStack
        Closes every device when the bench is left.
    """

    ports: Mapping[str, str]
    clock: Clock
    wavelength_nm: float
    open_devices: ExitStack
    axes: dict[str, RotaryAxis] = field(default_factory=dict)
    analyzers: dict[str, Analyzer] = field(default_factory=dict)
    detectors: dict[str, Detector] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    _shared: dict[str, Any] = field(default_factory=dict)

    def opened(self, device: T) -> T:
        """Take what is to be closed when the bench is left, before it is connected."""
        self.open_devices.callback(device.close)
        return device

    def shared(self, port: str, open_port: Callable[[], T]) -> T:
        """What drives a port that several devices share; opened for the first of them."""
        if port not in self._shared:
            self._shared[port] = self.opened(open_port())
        shared: T = self._shared[port]
        return shared

    def note(self, name: str, left_over: tuple[str, ...]) -> None:
        """Keep the errors that a device held from earlier use."""
        self.notes += [f"{name}: an error was left in its queue from earlier use: {error}" for error in left_over]
