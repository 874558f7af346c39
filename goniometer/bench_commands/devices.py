"""`goniometer devices`: the computer's ports, what answers there, and whether it is what a rig file expects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from serial.tools.list_ports import comports

from drivers.clock import WallClock
from goniometer.bench_commands.open_bench import Tell, reachable_rig
from goniometer.bench_commands.port_lock import holder_of
from goniometer.bench_commands.probe import Probed, expected_rounds, probe, rounds_for
from goniometer.errors import GoniometerError
from goniometer.rig_devices.entry import DeviceEntry
from goniometer.rig_file import Rig
from goniometer.signals import Interruption
from goniometer.wire_trace import wire_log


@dataclass(frozen=True)
class FoundPort:
    """A port: what the system says of it, and what answered.

    Attributes
    ----------
    port, description : str
        Its name, and the system's own words; empty for a port that the system does not list.
    usb : tuple of int, or None
        Vendor and product of the adapter, where it has them.
    probed : Probed
        What came of asking.
    """

    port: str
    description: str
    usb: tuple[int, int] | None
    probed: Probed

    def __str__(self) -> str:
        about = [self.description] if self.description not in ("", "n/a") else []
        about += [f"USB {self.usb[0]:04x}:{self.usb[1]:04x}"] if self.usb else []
        named = f"{self.port} [{', '.join(about)}]" if about else self.port
        return f"{named}: {self.probed}"


@dataclass(frozen=True)
class Expected:
    """A device of the rig file, and whether it answers where it should; None when that cannot be found out."""

    device: str
    driver: str
    port: str
    is_there: bool | None

    def __str__(self) -> str:
        verdict = {True: "is there", False: "IS NOT THERE", None: "cannot be asked"}[self.is_there]
        return f"{self.device} ({self.driver} on {self.port}): {verdict}"


@dataclass(frozen=True)
class Devices:
    """All ports that were to be asked, whether a person has named them, and what a rig file expects of them."""

    ports: tuple[FoundPort, ...]
    expected: tuple[Expected, ...] = ()
    were_named: bool = False

    def __str__(self) -> str:
        return "\n".join(map(str, [*self.ports, *self.expected])) or "This computer has no serial port."

    def require_all(self) -> None:
        """Raise GoniometerError unless every port that was named was asked, and every device expected is there."""
        if self.were_named and not all(port.probed.was_asked for port in self.ports):
            raise GoniometerError("Not every port could be asked: see above.")
        if not all(one.is_there for one in self.expected):
            raise GoniometerError("Not every device of the rig file was found: see above.")


def devices(ports: Sequence[str], rig_path: Path | None, tell: Tell, *, trace: Path | None = None) -> Devices:
    """Ask who answers at ports; nothing is moved and no setting is changed.

    Parameters
    ----------
    ports : sequence of str
        The ports to ask; those of the rig file, or else all serial ports of the computer, when there are none.
    rig_path : Path, optional
        A rig file whose expectations are checked.
    tell : callable
        Takes which port is being asked.
    trace : Path, optional
        Where every byte sent and received is written down.

    Raises
    ------
    ConfigurationError
        When the rig file cannot be used.
    ScanInterrupted
        On Ctrl-C, SIGTERM or SIGHUP, once the port in hand is closed.
    """
    rig = reachable_rig(rig_path) if rig_path else None
    listed = {port.device: port for port in comports()}
    of_rig = [one.port for one in rig.devices.values() if one.port] if rig else list(listed)
    asked = list(dict.fromkeys(ports or of_rig))
    found = []
    with Interruption() as interruption, wire_log(trace, WallClock()) as log:
        for port in asked:
            tell(f"asking at {port}")
            info = listed.get(port)
            usb = (info.vid, info.pid) if info and info.vid is not None and info.pid is not None else None
            expected = [one for device in _at(port, rig) for one in expected_rounds(port, device)]
            opened_by = next((device.opened_by for device in _at(port, rig) if device.opened_by), "")
            if opened_by:
                probed = Probed(held_by=str(holder_of(port) or ""), not_asked=f"it is opened by {opened_by}")
            else:
                probed = probe(port, list(dict.fromkeys(expected)), rounds_for(port, usb), log)
            found.append(FoundPort(port, info.description if info else "", usb, probed))
            interruption.check()
    by_port = {one.port: one.probed for one in found}
    return Devices(
        tuple(found),
        tuple(
            Expected(name, device.driver, device.port, _is_there(device, by_port[device.port]))
            for name, device in (rig.devices.items() if rig else ())
            if device.port in by_port
        ),
        were_named=bool(ports),
    )


def _at(port: str, rig: Rig | None) -> list[DeviceEntry]:
    return [device for device in rig.devices.values() if device.port == port] if rig else []


def _is_there(device: DeviceEntry, probed: Probed) -> bool | None:
    if probed.held_by or not expected_rounds(device.port, device):
        return None
    return any(
        device.driver.startswith(answer.driver)
        and (device.place is None or device.place.split()[-1] == answer.place.split()[-1])
        for answer in probed.answers
    )
