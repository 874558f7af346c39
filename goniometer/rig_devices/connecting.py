"""A bench that is being connected, device by device."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field
from typing import Any, Protocol, TypeVar, runtime_checkable

from acquisition.filters import Filters
from acquisition.protocols import Analyzer, Detector
from drivers.axis import Axis
from drivers.clock import Clock
from drivers.modbus.port import ModbusPort
from drivers.stage import Stage
from drivers.travel import Travel
from drivers.wire.link import Link
from drivers.wire.wire_log import WireLog


class Closable(Protocol):
    """What is closed when the bench is left."""

    def close(self) -> None:
        """Close the port."""
        ...


class Device(Closable, Protocol):
    """What is checked and set up when it is connected."""

    def connect(self) -> tuple[str, ...]:
        """Check the device and set it up; moves nothing. Returns what it held from earlier use, such as errors."""
        ...


@runtime_checkable
class Identified(Protocol):
    """What says which one of its make it is."""

    name: str
    identity: str


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
    wavelength_nm : float or None
        Told to detectors whose response depends on it; None leaves them the one that they have.
    open_devices : ExitStack
        Closes every device when the bench is left.
    wire_log : WireLog, optional
        Where every byte is written down.
    to_home : collection of str
        The axes that a person has asked to be homed: what homing cures does not keep them from being connected.
    sets_up : bool
        Whether devices are checked and set up. Who wants to stop a bench sends nothing before the stop.
    """

    ports: Mapping[str, str]
    clock: Clock
    wavelength_nm: float | None
    open_devices: ExitStack
    wire_log: WireLog | None = None
    to_home: Collection[str] = ()
    sets_up: bool = True
    axes: dict[str, Axis] = field(default_factory=dict)
    analyzers: dict[str, Analyzer] = field(default_factory=dict)
    generators: dict[str, Analyzer] = field(default_factory=dict)
    detectors: dict[str, Detector] = field(default_factory=dict)
    filters: Filters | None = None
    notes: list[str] = field(default_factory=list)
    identities: dict[str, str] = field(default_factory=dict)
    _shared: dict[str, Any] = field(default_factory=dict)

    def link(self, name: str, *, baudrate: int = 115200, rtscts: bool = False, most_logged: int | None = None) -> Link:
        """Open the port of a device that has one to itself."""
        return Link(
            self.ports[name],
            device=name,
            baudrate=baudrate,
            rtscts=rtscts,
            wire_log=self.wire_log,
            most_logged=most_logged,
        )

    def modbus(self, name: str, *, baudrate: int, parity: str) -> ModbusPort:
        """The Modbus port of a device, which other units may share."""
        return self.shared(
            name,
            lambda port: ModbusPort(port, device=name, baudrate=baudrate, parity=parity, wire_log=self.wire_log),
        )

    def add(self, name: str, device: Device) -> None:
        """Check and set up a device whose port is open; it is closed when the bench is left."""
        self._opened(device)
        if self.sets_up:
            self.notes += [f"{name}: left over from earlier use: {error}" for error in device.connect()]
            if isinstance(device, Identified):
                self.identities[device.name] = device.identity

    def add_axis(self, name: str, role: str, stage: Stage, travel: Travel) -> None:
        """Check and set up a stage of the device `name`, as `add` does, and put an axis on it."""
        self.add(name, stage)
        self.axes[role] = Axis(stage, self.clock, travel)

    def shared(self, name: str, open_port: Callable[[str], T]) -> T:
        """What drives the port of a device, which others may share; opened for the first of them."""
        port = self.ports[name]
        if port not in self._shared:
            self._shared[port] = self._opened(open_port(port))
        shared: T = self._shared[port]
        return shared

    def _opened(self, device: T) -> T:
        self.open_devices.callback(device.close)
        return device
