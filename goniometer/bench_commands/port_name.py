"""One name for a port, however it is spelt: a device file has links, a computer names and addresses."""

from __future__ import annotations

import ipaddress
import os
import socket
from functools import lru_cache
from urllib.parse import urlsplit


def one_name(port: str) -> str:
    """Return the same for all spellings of a port.

    A device file is the one that its links lead to. A computer on the network is its address, the lowest where it has
    several; all of this computer's own are one. One that has no address just now keeps its name. Case makes no
    difference.
    """
    if port.startswith("/dev/"):
        return os.path.realpath(port).lower()
    parts = urlsplit(port)
    if not parts.hostname:
        return port.lower()
    return f"{_address(parts.hostname)} port {parts.port}"


@lru_cache
def _address(host: str) -> str:
    try:
        found = {ipaddress.ip_address(str(info[4][0])) for info in socket.getaddrinfo(host, None)}
    except (OSError, UnicodeError, ValueError):  # nobody knows it, or its address has a zone
        return host.lower()
    if any(address.is_loopback for address in found):
        return "this computer"
    return str(min(found, key=lambda address: (address.version, int(address))))
