"""Where a device is connected, as a user writes it."""

from __future__ import annotations

import ipaddress
import re
from typing import Annotated
from urllib.parse import urlsplit

from pydantic import AfterValidator

_SERIAL_PORT = re.compile(r"COM[1-9]\d{0,2}|/dev/\S+")


def _socket_host(address: str, *schemes: str) -> str:
    """Host of an address such as ``socket://host:port``; ValueError when it is not one."""
    parts = urlsplit(address)
    if parts.scheme not in schemes or not parts.hostname or not parts.port or parts.path:
        raise ValueError
    return parts.hostname


def _check_port(port: str) -> str:
    if port == "simulated" or _SERIAL_PORT.fullmatch(port):
        return port
    try:
        _socket_host(port, "socket", "modbus-tcp", "http")
    except ValueError:
        raise ValueError(
            f"got {port!r}; allowed: a serial port such as COM3 or /dev/ttyUSB0, a serial server such as "
            "socket://192.168.0.10:4001, modbus-tcp://192.168.0.10:502 for Modbus TCP, "
            "http://192.168.0.10:80 for a camera, or simulated"
        ) from None
    return port


def _check_loopback(address: str) -> str:
    try:
        host = _socket_host(address, "socket")
        is_loopback = host == "localhost" or ipaddress.ip_address(host).is_loopback
    except ValueError:
        is_loopback = False
    if not is_loopback:
        raise ValueError(
            f"got {address!r}; allowed: an address on this computer, socket://127.0.0.1:PORT, as printed by "
            "goniometer simulate"
        )
    return address


Port = Annotated[str, AfterValidator(_check_port)]
LoopbackAddress = Annotated[str, AfterValidator(_check_loopback)]
