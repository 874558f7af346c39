"""Which process holds a port: a locked file a port, in a folder that belongs to the user alone.

The system drops the lock of a process that ends, however it ends, so a file that was left behind holds nothing. Windows
has no such locks and needs none: a COM port there opens for one process only.
"""

from __future__ import annotations

import hashlib
import json
import os
import stat
import sys
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from drivers.clock import Deadline, WallClock
from goniometer.bench_commands.port_name import one_name
from goniometer.errors import ConfigurationError, GoniometerError, NotConnectedError

if sys.platform != "win32":
    import fcntl

_LONGEST = 4096
_LOOK_S = 0.01
_UNKNOWN_FOR_S = 0.5


@dataclass(frozen=True)
class Holder:
    """A living process that holds a port; `command` is what it was started as."""

    pid: int
    command: str

    def __str__(self) -> str:
        return f"process {self.pid} ({self.command})"


@contextmanager
def held_ports(ports: Iterable[str]) -> Iterator[None]:
    """Hold ports in the name of this process while the block lasts; an empty one stands for none.

    Raises
    ------
    NotConnectedError
        When another process holds one of them; none is held then.
    ConfigurationError
        When two of them are one port, spelt differently.
    GoniometerError
        When the folder of the locks could be somebody else's.
    """
    ports = sorted(set(ports) - {""})
    _refuse_twice(ports)
    with ExitStack() as locks:
        if sys.platform != "win32":
            folder = locks.enter_context(_folder())
            for port in ports:
                locks.enter_context(_held(folder, port))
        yield


def holder_of(port: str) -> Holder | None:
    """The process that holds a port, as far as it is one of this program and of this user; raises GoniometerError."""
    if sys.platform == "win32":
        return None
    with _folder() as folder:
        try:
            file = os.open(_name(port), os.O_RDONLY | os.O_NOFOLLOW | os.O_CLOEXEC, dir_fd=folder)
        except OSError:  # never held, or a link, which is not followed
            return None
        with os.fdopen(file, "rb") as stream:
            try:
                fcntl.flock(stream, fcntl.LOCK_SH | fcntl.LOCK_NB)
            except BlockingIOError:
                return _living(stream.read(_LONGEST))
            return None


@contextmanager
def _held(folder: int, port: str) -> Iterator[None]:
    flags = os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC
    try:
        file = os.open(_name(port), flags, 0o600, dir_fd=folder)
    except OSError as error:
        raise _untrusted(f"its file {_name(port)} cannot be opened ({error.strerror})") from error
    with os.fdopen(file, "r+b", buffering=0) as stream:
        _lock(stream.fileno(), port)
        try:
            stream.truncate()
            stream.write(json.dumps({"port": port, "pid": os.getpid(), "command": _command()}).encode())
            yield
        finally:
            stream.truncate(0)  # the file stays: removed, it could be locked by two that opened it before and after


def _lock(file: int, port: str) -> None:
    """Lock a file; who only looks whether it is locked holds it for a moment, without a name in it."""
    clock = WallClock()
    deadline = Deadline(clock, _UNKNOWN_FOR_S)
    while True:
        with suppress(BlockingIOError):
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return
        holder = _living(os.pread(file, _LONGEST, 0))
        if holder is not None or deadline.has_passed():
            raise NotConnectedError(
                port,
                f"it is held by {holder or 'another process'}",
                not_done="no device was opened and nothing was moved",
                to_do="wait until the other program has ended, or end it with goniometer stop and the same rig file",
            )
        clock.sleep(_LOOK_S)


def _living(content: bytes) -> Holder | None:
    """Whom the content of a locked file names; None when that process is gone and a child of it keeps the lock."""
    try:
        said = json.loads(content)
        holder = Holder(int(said["pid"]), str(said["command"]))
        os.kill(holder.pid, 0)
    except (ValueError, KeyError, TypeError, ProcessLookupError):
        return None
    except PermissionError:
        pass
    return holder


@contextmanager
def _folder() -> Iterator[int]:
    """The folder of the locks, made when it is not there; nobody else may write to it, or be at its other end."""
    path = Path(tempfile.gettempdir()) / f"goniometer-{os.getuid()}"
    with suppress(FileExistsError):
        path.mkdir(mode=0o700)
    try:
        folder = os.open(path, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC)
    except OSError as error:
        raise _untrusted(f"{path} is no folder of its own ({error.strerror})") from error
    try:
        about = os.fstat(folder)
        if about.st_uid != os.getuid() or stat.S_IMODE(about.st_mode) & 0o077:
            raise _untrusted(f"{path} belongs to somebody else, or others may use it")
        yield folder
    finally:
        os.close(folder)


def _untrusted(why: str) -> GoniometerError:
    return GoniometerError(
        f"The folder that says which process holds which port cannot be used: {why}. No device was opened. Remove it, "
        "or have it removed, and start again."
    )


def _name(port: str) -> str:
    """A file's name for a port, the same for all spellings of it."""
    return hashlib.sha256(one_name(port).encode()).hexdigest()[:24]


def _refuse_twice(ports: Iterable[str]) -> None:
    """Raise ConfigurationError for two spellings of one port: each would be opened, and one device driven twice."""
    first: dict[str, str] = {}
    for port in ports:
        if (other := first.setdefault(one_name(port), port)) != port:
            raise ConfigurationError(
                [
                    f"The rig file names one port in two ways, {other} and {port}. No device was opened. Write it in "
                    "one way"
                ]
            )


def _command() -> str:
    return " ".join([Path(sys.argv[0]).name, *sys.argv[1:]])[:500]
