"""A scene to change, and three ways to hand bytes to a device."""

import copy
import heapq
import itertools
import socket
from urllib.parse import urlsplit

import pytest

from sim_devices.scene import Scene

SCENE = {
    "scene": "ground iron",
    "rig": "../rigs/simulated.yaml",
    "seed": 1,
    "sample": {"material": "Fe", "sigma": 0.1764, "rho_s": 0.7, "rho_d": 0.1, "rho_dd": 0.05},
    "lamp": {"power_w": 1.0e-3, "wavelength_nm": 550},
    "devices": {
        "arms": {"type": "newport_esp301", "axes": {1: "source_arm", 2: "detector_arm"}},
        "sample_stage": {"type": "oriental_az", "unit": 1, "axis": "sample_azimuth", "step_deg": 0.02},
        "analyzer": {
            "type": "thorlabs_fw102c",
            "slots": {1: "open", 2: 0, 3: 45, 4: 90, 5: 135, 6: "blocked"},
        },
        "meter": {"type": "thorlabs_pm100", "acceptance_sr": 1.0e-3},
    },
    "effects": [],
}


@pytest.fixture
def scene_document():
    """A scene as a YAML reader gives it, free to be changed."""
    return copy.deepcopy(SCENE)


@pytest.fixture
def scene_with(scene_document):
    """Make the scene, with some of its top-level parts replaced."""

    def make(**parts):
        return Scene.model_validate(scene_document | parts)

    return make


@pytest.fixture(params=["whole", "byte by byte", "with trailing bytes"])
def feed(request):
    """Hand a session its bytes in one of three ways; `trailing` begins a command and does not end it."""

    def hand_over(session, data, now_s=0.0, trailing=b""):
        if request.param == "byte by byte":
            return [reply for byte in data for reply in session.receive(bytes([byte]), now_s)]
        return session.receive(data + trailing * (request.param == "with trailing bytes"), now_s)

    return hand_over


def told(replies):
    """All that is said, also later."""
    for due_s, said in replies:
        if isinstance(said, bytes):
            yield due_s, said
        else:
            yield from told(said(due_s))


def text_of(replies):
    return b"".join(text for _, text in told(replies))


@pytest.fixture
def ask():
    """Hand a session a command, for the bytes that it answers."""

    def ask_session(session, data, now_s=0.0):
        return text_of(session.receive(data, now_s))

    return ask_session


class Conversation:
    """A session with all that it says, also what it says later and on its own."""

    def __init__(self, session):
        self._session = session
        self._due, self._order = [], itertools.count()
        self._heard = []

    def send(self, data, now_s=0.0):
        """Hand over bytes; what was due before has been said before."""
        self._listen(now_s)
        self._enter(self._session.receive(data, now_s))

    def hear(self, until_s):
        """The times and bytes that are due by then and were not returned before."""
        self._listen(until_s)
        heard, self._heard = self._heard, []
        return heard

    def _listen(self, until_s):
        while self._due and self._due[0][0] <= until_s:
            due_s, _, said = heapq.heappop(self._due)
            if isinstance(said, bytes):
                self._heard.append((due_s, said))
            else:
                self._enter(said(due_s))

    def _enter(self, due):
        for due_s, said in due:
            heapq.heappush(self._due, (due_s, next(self._order), said))


@pytest.fixture
def converse():
    """Begin a conversation with a device."""
    return lambda device: Conversation(device.session())


@pytest.fixture
def connect():
    """Open plain sockets to a bench's addresses, and close them after the test."""
    connections = []

    def open_socket(address):
        connection = socket.create_connection(("127.0.0.1", urlsplit(address.tcp).port), timeout=5)
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        connections.append(connection)
        return connection

    yield open_socket
    for connection in connections:
        connection.close()
