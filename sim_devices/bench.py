"""The simulated bench: every device of a scene, served on loopback TCP and, where there are any, pseudo-terminals."""

from __future__ import annotations

import os
from dataclasses import dataclass
from types import TracebackType

from sim_devices.clock import BenchClock
from sim_devices.device import Device
from sim_devices.reactor import Reactor
from sim_devices.scene import Scene
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

    Attributes
    ----------
    world : World
        What the devices act on.
    addresses : dict of str to Address
        Where each device is reached, by its name in the scene; empty before the start.
    """

    def __init__(self, scene: Scene, clock: BenchClock) -> None:
        self.clock = clock
        self.world = World(scene)
        self.addresses: dict[str, Address] = {}
        self._reactor = Reactor(clock)

    def start(self) -> None:
        """Open the ports and begin to serve them; once only."""
        for name, device in self.world.devices.items():
            self.addresses[name] = Address(self.listen(device), self._pty(device))
        self.clock.attach(self)
        self._reactor.start()

    def stop(self) -> None:
        """Close every port; raises DeviceFaultError when an error in the bench's own code had stopped it before."""
        self._reactor.stop()
        self._reactor.raise_failure()

    def listen(self, device: Device) -> str:
        """Serve one more device; returns its URL."""
        return f"socket://127.0.0.1:{self._reactor.listen(device)}"

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

    def _pty(self, device: Device) -> str | None:
        if not hasattr(os, "openpty"):
            return None
        try:
            return self._reactor.open_pty(device)
        except OSError:
            # a system that has run out of them, or was set up without; the address says so
            return None
