"""What a request costs: our drivers above bare pyserial, and the simulated bench beside other servers.

Client and servers have a processor each. Prints markdown tables.
"""

import json
import os
import selectors
import socket
import statistics
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path
from urllib.parse import urlsplit

import serial
from driver_requests import Recorder, requests

ROOT = Path(__file__).resolve().parent.parent
SERVERS = ROOT / "benchmarks" / "round_trip_servers.py"
SCENES = ROOT / "scenes" / "iron_noise_free.yaml", ROOT / "tests" / "interop" / "scenes" / "stages.yaml"
PEERS = ROOT / ".venv-bench" / "bin"
CLIENT_CPU, SERVER_CPU = 0, 1
PAIRS, IN_A_PAIR = 1000, 2
TURNS, TURN_S = 60, 0.04
SHARE_S, CONNECTIONS = 2.0, 12


@contextmanager
def started(*command):
    """Run a server on the processor of the servers, with its output for whoever reads it."""
    os.sched_setaffinity(0, {SERVER_CPU})
    server = subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, cwd=ROOT
    )
    os.sched_setaffinity(0, {CLIENT_CPU})
    try:
        yield server
    finally:
        server.kill()
        server.communicate()


@contextmanager
def serving(python, *arguments):
    """Run one of the servers of round_trip_servers.py; its addresses."""
    with started(str(python), str(SERVERS), *map(str, arguments)) as server:
        yield json.loads(server.stdout.readline())


def seconds(function, count):
    start = time.perf_counter()
    for _ in range(count):
        function()
    return time.perf_counter() - start


def paired(driver, bare):
    """Median over pairs of how many times as long the driver takes; every other pair begins with it."""
    ratios = []
    for _ in range(PAIRS // 2):
        ratios.append(seconds(driver, IN_A_PAIR) / seconds(bare, IN_A_PAIR))
        ratios.append(1 / (seconds(bare, IN_A_PAIR) / seconds(driver, IN_A_PAIR)))
    return statistics.median(ratios)


def driver_cost(request, exchanges):
    """Microseconds of the driver's call; its ratio to pyserial that knows the length, and that reads to the end."""
    with serial.serial_for_url(request.port, baudrate=115200, timeout=5) as port:

        def by_length():
            if request.silence_s:
                time.sleep(request.silence_s)
            for question, length in exchanges:
                port.write(question)
                assert len(port.read(length)) == length

        def by_terminator():
            for question, _ in exchanges:
                port.write(question)
                assert port.read_until(request.terminator).endswith(request.terminator)

        ratio = paired(request.call, by_length)
        usual = paired(request.call, by_terminator) if request.terminator else None
        return 1e6 * seconds(request.call, 500) / 500, ratio, usual


def over_pty(path, request):
    """A bare pyserial client, as a function that asks once; all replies are of the same length."""
    port = serial.Serial(path, baudrate=115200, timeout=0.2)
    port.write(request)
    length = len(port.read(4096))
    port.timeout = 5

    def ask():
        port.write(request)
        assert len(port.read(length)) == length

    return ask


def connect(url):
    address = urlsplit(url)
    connection = socket.create_connection((address.hostname, address.port), timeout=5)
    connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return connection


def over_tcp(url, request):
    """A bare socket, as a function that asks once; replies end with a line."""
    connection = connect(url)

    def ask():
        connection.sendall(request)
        reply = b""
        while not reply.endswith(b"\n"):
            reply += connection.recv(4096)

    return ask


def rates(asks):
    """Median and best requests a second of each, measured in turn for a moment, again and again."""
    counts = [max(3, round(TURN_S / (seconds(ask, 5) / 5))) for ask in asks]
    turns = [[count / seconds(ask, count) for ask, count in zip(asks, counts, strict=True)] for _ in range(TURNS)]
    return [f"{statistics.median(each):.0f} ({max(each):.0f})" for each in zip(*turns, strict=True)]


def shares(url, request):
    """Answers a second in all, and the least and greatest share of a connection, in shares that are fair."""
    counts = dict.fromkeys(range(CONNECTIONS), 0)
    with selectors.DefaultSelector() as selector:
        for number in counts:
            connection = connect(url)
            selector.register(connection, selectors.EVENT_READ, number)
            connection.sendall(request)
        end_s = time.perf_counter() + SHARE_S
        while time.perf_counter() < end_s:
            for key, _ in selector.select(1.0):
                counts[key.data] += key.fileobj.recv(4096).count(b"\n")
                key.fileobj.sendall(request)
        for key in list(selector.get_map().values()):
            key.fileobj.close()
    fair = sum(counts.values()) / CONNECTIONS
    return sum(counts.values()) / SHARE_S, min(counts.values()) / fair, max(counts.values()) / fair


def table(heads, rows):
    print("\n" + "\n".join(f"| {' | '.join(cells)} |" for cells in (heads, ["---"] * len(heads), *rows)))


def print_drivers():
    with serving(sys.executable, "bench", *SCENES) as addresses:
        rows, recorder = [], Recorder()
        for request in requests(addresses, recorder):
            request.call()
            exchanges = recorder.exchanges(request.call)
            call_us, ratio, usual = driver_cost(request, exchanges)
            cells = [f"{call_us:.0f} µs", f"{ratio:.2f}", "—" if usual is None else f"{usual:.2f}"]
            rows.append([request.title, str(len(exchanges)), *cells])
    table(["driver's call", "requests", "time", "over `read(n)`", "over `read_until`"], rows)


def print_servers():
    port = free_port()
    with (
        serving(sys.executable, "bench", *SCENES) as bench,
        serving(sys.executable, "echo") as echo,
        serving(PEERS / "python", "sinstruments") as sinstruments,
        started(
            *(str(PEERS / "lewis"), "-k", "lewis.examples", "example_motor"),
            *("-p", f"stream: {{bind_address: 127.0.0.1, port: {port}}}"),
        ),
    ):
        time.sleep(5.0)
        arms, meter = (*bench["arms"], b"1TP?\r"), (*bench["meter"], b"MEAS:POW?\n")
        servers = {
            "goniometer, ESP301 `TP?`": arms,
            "goniometer, PM100 `MEAS:POW?`": meter,
            "bare echo": (*echo["echo"], b"12.500000\n"),
            "sinstruments, one answer to every line": (*sinstruments["position"], b"1TP?\n"),
        }
        asks = [over_tcp(url, request) for url, _, request in servers.values()]
        asks += [over_pty(path, request) for _, path, request in servers.values()]
        *found, of_lewis = rates([*asks, over_tcp(f"socket://127.0.0.1:{port}", b"P?\r\n")])
        crowds = [shares(url, request) for url, _, request in (arms, meter)]
        with connect(arms[0]) as controller:
            controller.sendall(b"1MO;2MO;2VA0.01;2PA80\r")
        (in_motion,) = rates([over_tcp(meter[0], meter[2])])
    rows = [[title, *each] for title, *each in zip(servers, found, found[len(servers) :], strict=False)]
    rows.insert(2, ["goniometer, PM100 `MEAS:POW?`, an arm in motion", in_motion, "—"])
    rows.append(["lewis, its example motor", of_lewis, "—"])
    table(["requests a second, median (best)", "TCP", "pty"], rows)
    table(
        [f"{CONNECTIONS} connections at once", "requests a second", "least share", "greatest share"],
        [
            [title, f"{per_s:.0f}", f"{least:.2f}", f"{most:.2f}"]
            for title, (per_s, least, most) in zip(servers, crowds, strict=False)
        ],
    )


def free_port():
    with socket.create_server(("127.0.0.1", 0)) as probe:
        return probe.getsockname()[1]


if __name__ == "__main__":
    print_drivers()
    print_servers()
