"""The simulated bench: every device of a scene, served on loopback TCP and, where there are any, pseudo-terminals."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType

from goniometer.errors import DeviceFaultError
from sim_devices.device import Device, Reports, Tell
from sim_devices.faults.switchboard import Switchboard
from sim_devices.modbus.tcp import ModbusTcp
from sim_devices.past import Past
from sim_devices.scene import Scene
from sim_devices.serving.clock import BenchClock
from sim_devices.serving.reactor import Reactor
from sim_devices.serving.shared_line import SharedLine
from sim_devices.world import World


@dataclass(frozen=True)
class Address:
    """Where a device is reached: a URL for TCP, and the path of a pseudo-terminal where the system has them."""

    tcp: str
    pty: str | None


class Bench:
    """A scene's devices, ready to be spoken to from `start` to `stop`, or inside a ``with`` block.

    Parameters
    ----------
    scene : Scene
        What the bench holds.
    clock : BenchClock
        The time it runs on.
    past : Past
        What it has been through before.
    folder : Path
        Where relative paths in the scene begin.

    Attributes
    ----------
    world : World
        What the devices act on.
    addresses : dict of str to Address
        Where each device is reached, by its name in the scene; empty before the start.
    faults : Switchboard
        Where what goes wrong is switched on; those of the scene are from the start.
    """

    def __init__(
        self,
        scene: Scene,
        clock: BenchClock,
        past: Past = Past(),  # noqa: B008 (frozen)
        folder: Path = Path(),
    ) -> None:
        self.clock = clock
        self.world = World(scene, past, folder)
        self.addresses: dict[str, Address] = {}
        self._reactor = Reactor(clock)
        self._ports: dict[str, Device] = {}
        self.faults = Switchboard(self.world, self._ports, self._reactor, clock)

    def start(self) -> None:
        """Open the ports and begin to serve them; once only."""
        for names in self._lines():
            members = [self.world.devices[name] for name in names]
            device = members[0] if len(members) == 1 else _on_one_line(members)
            scheme = self.world.scene.devices[names[0]].scheme
            address = Address(self.listen(device, scheme), self._pty(device) if scheme == "socket" else None)
            self.addresses |= dict.fromkeys(names, address)
            self._ports |= dict.fromkeys(names, device)
        for name, device in self.world.devices.items():
            if isinstance(device, Reports):
                device.tell = self._teller(name)
        for fault in self.world.scene.faults:
            self.faults.switch_on(fault)
        self.clock.attach(self)
        self._reactor.start()

    def stop(self) -> None:
        """Close every port.

        Raises
        ------
        DeviceFaultError
            When an error in the bench's own code had stopped it before, or parts of the bench have touched.
        """
        self._reactor.stop()
        self._reactor.raise_failure()
        watch = self.world.contact_watch
        if watch is not None and (contact := watch.look(self.clock.now())) is not None:
            raise DeviceFaultError(
                "simulated bench",
                f"{contact.parts} touched after {contact.time_s:.3f} s",
                not_done="nothing was hindered here; a real bench would be damaged",
                to_do="name the angles where parts would touch in collision_zones in the rig file",
            )

    def listen(self, device: Device, scheme: str = "socket") -> str:
        """Serve one more device; returns its URL."""
        return f"{scheme}://127.0.0.1:{self._reactor.listen(device)}"

    def serve(self) -> None:
        """Take everything that clients have sent, and answer what is due, in the caller's thread."""
        self._reactor.serve()

    def raise_failure(self) -> None:
        """Raise DeviceFaultError when an error in the bench's own code has stopped it."""
        self._reactor.raise_failure()

    def __enter__(self) -> Bench:
        self.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.stop()

    def _lines(self) -> list[list[str]]:
        """The names of the devices that share a port, one list a port."""
        lines: dict[str, list[str]] = {}
        for name in self.world.devices:
            line = self.world.scene.devices[name].line
            lines.setdefault(f"device {name}" if line is None else f"line {line}", []).append(name)
        return list(lines.values())

    def _teller(self, name: str) -> Tell:
        def tell(time_s: float, data: bytes) -> None:
            self.faults.at(time_s, lambda _: self.faults.say(name, data))

        return tell

    def _pty(self, device: Device) -> str | None:
        if not hasattr(os, "openpty"):
            return None
        try:
            return self._reactor.open_pty(device)
        except OSError:
            # a system that has run out of them, or was set up without; the address says so
            return None


def _on_one_line(members: Sequence[Device]) -> Device:
    """What answers where several devices share a port: their line, or the one gateway to all of them."""
    gateways = [member for member in members if isinstance(member, ModbusTcp)]
    return ModbusTcp.joined(gateways) if len(gateways) == len(members) else SharedLine(members)
