"""Answers of HTTP servers, whole, byte by byte and with bytes behind them; and whatever else may come."""

from __future__ import annotations

import random

import pytest

from drivers.camera.http_exchange import HttpExchange
from goniometer.errors import ReplyError

LENGTH = b"HTTP/1.1 200 OK\r\nContent-Type: image/png\r\nContent-Length: 5\r\nX-Frame-Number: 7\r\n\r\nhello"
CHUNKS = b"HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\n2\r\nhe\r\n3;a=b\r\nllo\r\n0\r\nX-Late: 1\r\n\r\n"
ERROR = b"HTTP/1.1 503 Busy\r\nContent-Length: 5\r\n\r\nhello"
CONTINUED = b"HTTP/1.1 100 Continue\r\n\r\n" + LENGTH
BARE = b"HTTP/1.1 200 OK\nContent-Length:5\n\nhello"
TO_END = b"HTTP/1.0 200 OK\r\n\r\nhello"
CLOSING = b"HTTP/1.1 200 OK\r\nConnection: close\r\nContent-Length: 5\r\n\r\nhello"
ANSWERS = {
    "length": (LENGTH, 200, True),
    "chunks": (CHUNKS, 200, True),
    "error": (ERROR, 503, True),
    "continued": (CONTINUED, 200, True),
    "bare line ends": (BARE, 200, True),
    "closing": (CLOSING, 200, False),
}
MOST = 1000


@pytest.fixture
def exchange():
    exchange = HttpExchange("camera", "a:80", MOST)
    assert exchange.request("/still.png?a=1") == b"GET /still.png?a=1 HTTP/1.1\r\nHost: a:80\r\nAccept: */*\r\n\r\n"
    return exchange


@pytest.mark.parametrize("answer", ANSWERS)
def test_fed_whole(exchange, answer):
    sent, status, keeps = ANSWERS[answer]
    assert not exchange.can_ask
    response = exchange.receive(sent)
    assert (response.status, response.body, exchange.can_ask) == (status, b"hello", keeps)


@pytest.mark.parametrize("answer", ANSWERS)
def test_fed_byte_by_byte(exchange, answer):
    sent, status, keeps = ANSWERS[answer]
    *before, response = [exchange.receive(sent[at : at + 1]) for at in range(len(sent))]
    assert set(before) == {None}
    assert (response.status, response.body, exchange.can_ask) == (status, b"hello", keeps)


@pytest.mark.parametrize("answer", ANSWERS)
def test_bytes_behind_an_answer_are_none_of_the_next(exchange, answer):
    response = exchange.receive(ANSWERS[answer][0] + ERROR)
    assert (response.status, response.body) == (ANSWERS[answer][1], b"hello")
    assert not exchange.can_ask


def test_several_answers_over_one_connection(exchange):
    for sent, status in ((LENGTH, 200), (ERROR, 503), (CHUNKS, 200)):
        assert exchange.receive(sent).status == status
        exchange.request("/")
    assert not exchange.has_begun


def test_an_answer_that_ends_with_the_connection(exchange):
    assert exchange.receive(TO_END) is None
    assert exchange.receive(b"").body == b"hello"
    assert not exchange.can_ask


def test_headers_have_names_in_lower_case(exchange):
    assert exchange.receive(LENGTH).headers["x-frame-number"] == "7"


@pytest.mark.parametrize(
    ("sent", "message"),
    [
        (b"SSH-2.0-OpenSSH_9.6\r\n\r\n", "no HTTP"),
        (b"HTTP/1.1 200 OK\r\nContent-Length: -5\r\n\r\n", "no HTTP"),
        (b"HTTP/1.1 200 OK\r\nContent-Length: 5\r\nContent-Length: 6\r\n\r\n", "no HTTP"),
        (b"HTTP/1.1 200 OK\r\nContent-Length: 1001\r\n\r\n", "an answer of 1001 bytes, where at most 1000 can be"),
        (b"HTTP/1.1 200 OK\r\nContent-Length: " + b"9" * 5000 + b"\r\n\r\n", "no HTTP"),
        (TO_END + bytes(MOST), "more than the 1000 bytes"),
        (
            b"HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\n" + b"400\r\n" + bytes(1024) + b"\r\n",
            "more than the 1000",
        ),
        (b"HTTP/1.1 101 Other\r\nUpgrade: x\r\n\r\n", "no HTTP"),
        (b"a" * 200_000, "no HTTP"),
    ],
)
def test_what_is_no_answer_is_refused(exchange, sent, message):
    with pytest.raises(ReplyError, match=message):
        exchange.receive(sent)
    assert not exchange.can_ask


@pytest.mark.parametrize("answer", ["length", "chunks"])
def test_an_answer_cut_anywhere_is_refused(answer):
    sent = ANSWERS[answer][0]
    for cut in range(len(sent)):
        exchange = HttpExchange("camera", "a:80", MOST)
        exchange.request("/")
        if cut:
            assert exchange.receive(sent[:cut]) is None
        with pytest.raises(ReplyError, match=r"not complete|nothing before it hung up"):
            exchange.receive(b"")


def test_any_bytes_are_an_answer_or_refused_and_never_fill_the_memory():
    generator = random.Random(7)
    sources = [answer[0] for answer in ANSWERS.values()] + [TO_END]
    refused = taken = 0
    for _ in range(20_000):
        sent = bytearray(generator.choice(sources))
        for _ in range(generator.randint(1, 4)):
            at = generator.randrange(len(sent))
            change = generator.randrange(3)
            if change == 0:
                sent[at] = generator.randrange(256)
            elif change == 1:
                del sent[at : at + generator.randint(1, 5)]
            else:
                sent[at:at] = bytes(generator.randrange(256) for _ in range(generator.randint(1, 5)))
            if not sent:
                sent += b"\r"
        exchange = HttpExchange("camera", "a:80", MOST)
        exchange.request("/")
        try:
            response = None
            while sent and response is None:
                length = generator.randint(1, 200)
                response = exchange.receive(bytes(sent[:length]))
                del sent[:length]
            response = response or exchange.receive(b"")
        except ReplyError:
            refused += 1
        else:
            taken += 1
            assert len(response.body) <= MOST
            assert 200 <= response.status < 1000
    assert min(refused, taken) > 2000
