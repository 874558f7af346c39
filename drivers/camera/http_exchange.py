"""HTTP/1.1 as bytes in, responses out (RFC 9112): one connection to a server, one question at a time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import h11

from goniometer.errors import ReplyError

_LONGEST_TEXT = 300


@dataclass(frozen=True)
class HttpResponse:
    """An answer; the names of its headers are in lower case."""

    status: int
    headers: Mapping[str, str]
    body: bytes

    @property
    def text(self) -> str:
        """What a server says to a person, on one line, shortened."""
        words = " ".join(self.body[: 4 * _LONGEST_TEXT].decode("utf-8", "replace").split())
        return words if len(words) <= _LONGEST_TEXT else f"{words[:_LONGEST_TEXT]}…"


class HttpExchange:
    """One connection.

    Parameters
    ----------
    name : str
        The device's name in the rig file, for messages.
    host : str
        Of the server, with its port.
    most_bytes : int
        Longest body that is taken; a server that announces or sends more is not listened to any longer.
    """

    def __init__(self, name: str, host: str, most_bytes: int) -> None:
        self._name, self._host, self._most_bytes = name, host, most_bytes
        self._connection = h11.Connection(h11.CLIENT)
        self._head: h11.Response | None = None
        self._body = bytearray()
        self._ended = False
        self.has_begun = False

    def request(self, path: str) -> bytes:
        """The question for a path, once the connection `can_ask`."""
        if self._ended:
            self._connection.start_next_cycle()
        self._head, self._ended, self.has_begun = None, False, False
        self._body.clear()
        headers = [("Host", self._host), ("Accept", "*/*")]
        return (self._connection.send(h11.Request(method="GET", target=path, headers=headers)) or b"") + (
            self._connection.send(h11.EndOfMessage()) or b""
        )

    @property
    def can_ask(self) -> bool:
        """Whether a question can be asked: the answer to the one before has come whole, and nothing behind it."""
        states = set(self._connection.states.values())
        return states in ({h11.IDLE}, {h11.DONE}) and not self._connection.trailing_data[0]

    def receive(self, data: bytes) -> HttpResponse | None:
        """Take bytes that have come, none when the server has hung up; return the answer once it is whole.

        Raises
        ------
        ReplyError
            When what comes is no HTTP, ends too early, or is longer than a picture can be.
        """
        self.has_begun = True
        if not data and self._head is None:
            raise self._refused("nothing before it hung up")
        try:
            self._connection.receive_data(data)
            while not self._ended:
                event = self._connection.next_event()
                if event is h11.NEED_DATA:
                    return None
                self._take(event)
        except (
            h11.RemoteProtocolError,
            ValueError,
        ) as error:  # older versions let numbers of thousands of digits through
            raise self._refused(f"an answer that is no HTTP or not complete ({error})") from None
        assert self._head is not None, "an answer has a head before it ends"
        headers = {name.decode("latin-1"): value.decode("latin-1") for name, value in self._head.headers}
        return HttpResponse(self._head.status_code, headers, bytes(self._body))

    def _take(self, event: object) -> None:
        if isinstance(event, h11.Response):
            self._head = event
            announced = dict(event.headers).get(b"content-length", b"0")
            if int(announced) > self._most_bytes:
                raise self._refused(f"an answer of {int(announced)} bytes, where at most {self._most_bytes} can be")
        elif isinstance(event, h11.Data):
            self._body += event.data
            if len(self._body) > self._most_bytes:
                raise self._refused(f"more than the {self._most_bytes} bytes that can be")
        elif isinstance(event, h11.EndOfMessage):
            self._ended = True
        elif not isinstance(event, h11.InformationalResponse):
            raise self._refused("something that is no answer")

    def _refused(self, what: str) -> ReplyError:
        return ReplyError(
            self._name,
            f"the camera has sent {what}",
            not_done="the answer was thrown away",
            to_do="check that the address in the rig file is the camera's, and look at the network between",
        )
