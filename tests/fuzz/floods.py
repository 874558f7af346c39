"""Long streams without an end, or without a pause: what is kept of them stays small, and a byte costs what it costs."""

from __future__ import annotations

import random
import time
import traceback
import tracemalloc
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from device_run import Talk, Wire
from device_targets import WIRES
from garbling_port import FuzzClock, open_link
from parser_targets import APT_FRAMES, LINE_READERS, RTU_BODIES

from drivers.modbus.frames import RtuFraming, TcpFraming
from drivers.thorlabs_apt.messages import Garbled, take_message
from drivers.wire.framing import take_frame
from goniometer.errors import ReplyError

MOST_KEPT_BYTES, MOST_GROWN_BYTES = 131_072, 4096
_MEANINGLESS = ("one letter", "one digit", "chance")  # what is said of a motion waits for its end
_PIECE = 4096
_ONE_BY_ONE = 64
_BYTE_S = 1.1e-3
_SHORTEST = 8192  # in smaller ones no buffer gets full


@dataclass(frozen=True)
class Flood:
    """What one stream did to one parser; `slowing` is the time of a byte over that in an eighth of the stream."""

    name: str
    stream: str
    piece: int
    kept_bytes: int
    us_per_byte: float
    slowing: float
    failure: str = ""


Feed = Callable[[bytes], None]


def floods(count: int, only: str) -> Iterator[Flood]:
    """Feed streams of `count` bytes, though not too few, to all parsers whose name contains `only`."""
    for name, (begin, frames) in _parsers().items():
        if only not in f"{name}/flood":
            continue
        for stream, data in _streams(frames, max(count, _SHORTEST)):
            yield _flood(name, stream, begin, data, _PIECE)
            if name not in LINE_READERS:
                yield _flood(name, stream, begin, data[: max(len(data) // _ONE_BY_ONE, 512)], 1)


def _flood(name: str, stream: str, begin: Callable[[], Feed], data: bytes, piece: int) -> Flood:
    try:
        before_s, seconds = _seconds(begin(), data[: len(data) // 8], piece), _seconds(begin(), data, piece)
        kept_bytes, grown_bytes = _memory(begin(), data, piece) if stream in _MEANINGLESS else (0, 0)
    except Exception:  # noqa: BLE001 - whatever it is, it is what we look for
        return Flood(name, stream, piece, 0, 0.0, 0.0, traceback.format_exc())
    is_bounded = kept_bytes < MOST_KEPT_BYTES and grown_bytes < MOST_GROWN_BYTES
    failure = (
        "" if is_bounded else f"{kept_bytes} bytes are kept of {len(data)}, and {grown_bytes} more of as many again"
    )
    slowing = seconds / 8 / max(before_s, 1e-6)
    return Flood(name, stream, piece, kept_bytes, 1e6 * seconds / len(data), slowing, failure)


def _seconds(feed: Feed, data: bytes, piece: int) -> float:
    begun_s = time.thread_time()
    for place in range(0, len(data), piece):
        feed(data[place : place + piece])
    return time.thread_time() - begun_s


def _memory(feed: Feed, data: bytes, piece: int) -> tuple[int, int]:
    """Bytes held after the stream has come twice, and how many more after it has come again."""
    held = []
    tracemalloc.start()
    for _ in range(3):
        _seconds(feed, data, piece)
        held.append(tracemalloc.get_traced_memory()[0])
    tracemalloc.stop()
    return held[1], held[2] - held[1]


def _streams(frames: list[bytes], count: int) -> Iterator[tuple[str, bytes]]:
    random_ = random.Random(count)
    yield "one letter", b"A" * count
    yield "one digit", b"1" * count
    yield "chance", random_.randbytes(count)
    yield "beginnings", (b"".join(frame[:-1] for frame in frames) * (1 + count // 10))[:count]
    yield "frames", (b"".join(frames) * (1 + count // 10))[:count]
    yield "first frame", (frames[0] * (1 + count // len(frames[0])))[:count]


def _parsers() -> dict[str, tuple[Callable[[], Feed], list[bytes]]]:
    parsers: dict[str, tuple[Callable[[], Feed], list[bytes]]] = {
        f"{name}/device": (lambda wire=wire: _device(wire), list(wire.frames)) for name, wire in WIRES.items()
    }
    rtu, tcp = RtuFraming(), TcpFraming()
    tcp.wrap(1, b"\3")
    announced = b"\1\3\xfa"
    parsers |= {
        name: (lambda read=read: _long_line(read), [b"00", b". ", b", ", b'""', b"\0\r"])
        for name, read in LINE_READERS.items()
    }
    parsers |= {
        "lines/driver": (lambda: _link(lambda received: take_frame(received, b"\r\n")), [b"12.5\r\n", b"0, 1, NO\r\n"]),
        "modbus_rtu/driver": (lambda: _link(lambda received: rtu.take(received, 1)), [announced, *RTU_BODIES]),
        "modbus_tcp/driver": (
            lambda: _link(lambda received: tcp.take(received, 1)),
            [bytes(6) + b"\1\3", b"\0\1\0\0\0\xfa\1"],
        ),
        "apt/driver": (lambda: _link(_message), APT_FRAMES),
    }
    return parsers


def _device(wire: Wire) -> Feed:
    """A client whose bytes come at the pace of the slowest serial line."""
    bench = wire.build()
    talk = Talk(bench.device)

    def feed(data: bytes) -> None:
        bench.accepted.clear()
        talk.send(data)
        talk.now_s += len(data) * _BYTE_S

    return feed


def _long_line(read: Callable[[bytes], str]) -> Feed:
    """A line of each length up to the longest that a link lets through."""

    def feed(data: bytes) -> None:
        for line in (data + data, b"1" + data, data + data + b',"x"', data + b"x"):
            read(line)

    return feed


class _Stream:
    """A port on which one piece after the other arrives."""

    def __init__(self) -> None:
        self.piece = b""

    def open(self) -> None:
        """Do nothing."""

    def receive(self, wait_s: float) -> bytes:
        """The piece, once."""
        piece, self.piece = self.piece, b""
        return piece


def _link(take: Callable[[bytearray], object]) -> Feed:
    port = _Stream()
    link = open_link(port, FuzzClock())  # type: ignore[arg-type]

    def feed(data: bytes) -> None:
        port.piece = data
        try:
            while link.poll(take) is not None:
                continue
        except ReplyError:
            assert len(link._received) == 0

    return feed


def _message(received: bytearray) -> object:
    while True:
        try:
            return take_message(received)
        except Garbled:
            del received[:1]
