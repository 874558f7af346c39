"""The questions of `goniometer devices`: each family is known by its answer, and nobody is moved or changed by them."""

import itertools
from dataclasses import replace

import pytest

from drivers.modbus.frames import RtuFraming
from goniometer.bench_commands.identify import ELLIPTEC, az, lec
from goniometer.bench_commands.probe import APT_USB, SERIAL, SOCKET, probe, rounds_for
from sim_devices.axis import Axis
from sim_devices.newport_esp301.controller import NewportEsp301
from sim_devices.oriental_az.drive import OrientalAz
from sim_devices.smc_lec.controller import SmcLec
from sim_devices.stanford_sr830.instrument import StanfordSr830
from sim_devices.thorlabs_apt.controller import ThorlabsApt
from sim_devices.thorlabs_apt.models import BSC200_HDR50, K10CR1
from sim_devices.thorlabs_elliptec.bus import ThorlabsElliptec
from sim_devices.thorlabs_elliptec.rotator import STEP_DEG, ElliptecRotator
from sim_devices.thorlabs_fw102c import ThorlabsFw102c
from sim_devices.thorlabs_pm100.meter import ThorlabsPm100
from sim_devices.wheel import Wheel


class Light:
    def power_w(self, time_s):
        return 1e-6

    def measure_w(self, time_s, exposure_s):
        return 1e-6


class ChoppedLight:
    def open_w(self, time_s, exposure_s):
        return 1e-6

    def closed_w(self, time_s, exposure_s):
        return 0.0

    def noise_w(self, time_s, exposure_s):
        return 0.0


def short(number, address, first=1, second=0):
    return bytes((number & 255, number >> 8, first, second, address, 1))


def modbus(unit, *requests):
    return [RtuFraming().wrap(unit, bytes.fromhex(request)) for request in requests]


# How it is made on axes and a wheel, how it is named, its rate, and what shows that its settings are the same.
FAMILIES = {
    "esp301": (
        lambda axes, wheel: NewportEsp301({1: axes[0], 2: axes[1]}),
        "newport_esp301",
        (19200, "N"),
        [b"1VA?\r", b"1AC?\r", b"1MO?\r", b"2TP?\r", b"1SL?\r", b"2SN?\r", b"1OM?\r"],
    ),
    "k10cr1": (
        lambda axes, wheel: ThorlabsApt(K10CR1, {1: axes[0]}),
        "thorlabs_apt",
        (115200, "N"),
        [short(number, 0x50) for number in (0x0414, 0x0411, 0x0441, 0x0211, 0x0417, 0x043B, 0x0480)],
    ),
    "bsc202": (
        lambda axes, wheel: ThorlabsApt(BSC200_HDR50, {1: axes[0], 2: axes[1]}),
        "thorlabs_apt",
        (115200, "N"),
        [short(number, bay) for number in (0x0414, 0x0411, 0x0211, 0x0480) for bay in (0x21, 0x22)],
    ),
    "ell14": (
        lambda axes, wheel: ThorlabsElliptec(ElliptecRotator(axes[0], spread=0), "7"),
        "thorlabs_elliptec address 7",
        (9600, "N"),
        [b"7gs", b"7gp", b"7gj", b"7go", b"7gv", b"7i1"],
    ),
    "fw102c": (
        lambda axes, wheel: ThorlabsFw102c(wheel, range(1, 7)),
        "thorlabs_fw102c",
        (115200, "N"),
        [f"{name}?\r".encode() for name in ("pos", "pcount", "speed", "trig", "sensors", "baud")],
    ),
    "az": (
        lambda axes, wheel: OrientalAz(1, axes[0]),
        "oriental_az unit 1",
        (115200, "E"),
        modbus(1, "03 00 58 00 10", "03 00 7C 00 06", "03 00 C6 00 0C"),
    ),
    "lec": (
        lambda axes, wheel: SmcLec(1, axes[0]),
        "smc_lec unit 1",
        (38400, "N"),
        modbus(1, "01 00 10 00 30", "02 00 40 00 10", "03 90 00 00 07", "03 91 02 00 10"),
    ),
    "pm100": (
        lambda axes, wheel: ThorlabsPm100(Light()),
        "thorlabs_pm100",
        (115200, "N"),
        [b"SENS:CORR:WAV?\n", b"SENS:AVER?\n", b"SENS:POW:RANG?\n", b"SENS:POW:RANG:AUTO?\n", b"SENS:POW:UNIT?\n"],
    ),
    "sr830": (
        lambda axes, wheel: StanfordSr830(ChoppedLight()),
        "stanford_sr830",
        (9600, "N"),
        [f"{name}?\r".encode() for name in ("SENS", "OFLT", "OFSL", "FMOD", "PHAS", "SLVL", "HARM", "RMOD", "FREQ")],
    ),
}
READY = {
    "esp301": [b"1MO\r2MO\r"],
    "lec": modbus(1, "05 00 30 FF 00", "05 00 19 FF 00", "05 00 1C FF 00"),
}
"""What switches a family's motors on."""
END_LINE = {"pm100": b"\n", "sr830": b"\r", "esp301": b"WT0\r", "fw102c": b"999!\r", "ell14": b"\r"}
"""What ends a line that was begun, before a family is asked for its settings."""


class Heard:
    """A device that has heard something; it stands where no command leaves it by chance."""

    def __init__(self, family, sendings):
        self.axes = [Axis(STEP_DEG if family == "ell14" else 0.001, 12.0) for _ in range(2)]
        self.wheel = Wheel()
        make, _, _, self._questions = FAMILIES[family]
        self._session = make(self.axes, self.wheel).session()
        self.motions, self._now_s = [], 0.0
        for data in READY.get(family, ()):
            self._send(data)
        self._now_s = 100.0
        for axis in self.axes:
            axis.before_motion.append(self.motions.append)
        for data in sendings:
            self._send(data)
        self._send(END_LINE.get(family, b""))

    def _send(self, data):
        self._now_s += 0.5
        return b"".join(due[1] for due in self._session.receive(data, self._now_s) if isinstance(due[1], bytes))

    def settings(self):
        self._now_s = 1000.0
        return [self._send(question) for question in self._questions]

    def is_untouched(self):
        return not self.motions and self.wheel.slot(self._now_s) == 1


def sendings(rounds):
    """Every question, twice over, as when nobody answers: more is never sent."""
    return [question.data for one in rounds for question in one.questions for _ in range(2)]


def heard_at(rate, data, sent_at):
    """The bytes that a receiver makes of bytes sent at another rate: it samples in the middle of its own bits."""
    (baud, parity), (own_baud, own_parity) = sent_at, rate
    levels = []
    for byte in data:
        bits = [byte >> place & 1 for place in range(8)]
        levels += [0, *bits, *([sum(bits) % 2] if parity == "E" else []), 1]
    duration_s = (len(levels) + 30) / baud

    def level(time_s):
        place = int(time_s * baud)
        return levels[place] if place < len(levels) else 1

    received, time_s, step_s = bytearray(), 0.0, 0.02 / max(baud, own_baud)
    character_bits = 10.5 if own_parity == "E" else 9.5
    while time_s < duration_s:
        if level(time_s) == 0:
            received.append(sum(level(time_s + (place + 1.5) / own_baud) << place for place in range(8)))
            time_s += character_bits / own_baud
        time_s += step_s
    return bytes(received)


@pytest.mark.parametrize("family", FAMILIES)
def test_no_question_moves_anything_or_changes_a_setting(family):
    heard = Heard(family, sendings(SOCKET))
    assert heard.is_untouched()
    assert heard.settings() == Heard(family, []).settings()


@pytest.mark.parametrize("family", FAMILIES)
def test_no_question_does_so_when_it_is_the_only_one(family):
    """The rig file may have any question asked first."""
    fresh = Heard(family, []).settings()
    for data in {question.data for one in (*SOCKET, *SERIAL) for question in one.questions}:
        heard = Heard(family, [data, data])
        assert heard.is_untouched()
        assert heard.settings() == fresh


@pytest.mark.parametrize("family", FAMILIES)
def test_no_question_does_so_at_whatever_rate_it_is_sent(family):
    """On a serial port a device of one rate hears questions at all the others, as other bytes."""
    rate = FAMILIES[family][2]
    rates = [rate, (921600, "N")] if family == "esp301" else [rate]
    for own in rates:
        heard = Heard(
            family,
            [
                heard_at(own, data, (one.baudrate, one.parity))
                for one in (*SERIAL, *APT_USB)
                for data in sendings([one])
            ],
        )
        assert heard.is_untouched()
        assert heard.settings() == Heard(family, []).settings()


def test_a_receiver_of_the_senders_rate_hears_what_was_sent():
    data = bytes(range(256))
    for rate in ((9600, "N"), (115200, "E")):
        assert heard_at(rate, data, rate) == data
    assert heard_at((9600, "N"), b"0in  \r", (115200, "N")) != b"0in  \r"


def test_the_harm_that_the_tests_look_for_is_seen():
    assert not Heard("esp301", [b"1PA20\r"]).is_untouched()
    assert not Heard("fw102c", [b"pos=3\r"]).is_untouched()
    assert Heard("esp301", [b"1VA3\r"]).settings() != Heard("esp301", []).settings()
    assert Heard("k10cr1", [short(0x0210, 0x50, 1, 2)]).settings() != Heard("k10cr1", []).settings()
    assert Heard("pm100", [b"SENS:AVER 7\n"]).settings() != Heard("pm100", []).settings()


def test_no_message_to_a_motor_can_be_read_out_of_the_questions_in_any_step():
    """Were an APT controller out of step, it could take any byte for the first of a message: a motor hears 0x04.."""
    text = b"".join(sendings((*SOCKET, *SERIAL)))
    assert 0x04 not in text
    units = [question(unit).data for unit in range(1, 32) for question in (az, lec)]
    for before, after in itertools.product(units, (*units, b"\x05\x00\x00\x00\x50\x01", b"*IDN?\n")):
        for at in range(len(before)):
            message = (before + after)[at : at + 6]
            is_heard = message[4] & 0x7F in (0x50, 0x11, *range(0x21, 0x2B))
            is_for_a_motor = is_heard and (message[1] == 0x04 or message[:2] == b"\x10\x02")
            assert not is_for_a_motor, f"{before.hex()} {after.hex()}"


def test_text_keeps_an_apt_controller_in_step():
    for question in SOCKET[0].questions[:19]:
        assert len(question.data) == 6
        assert not question.data[4] & 0x80
    assert SOCKET[0].questions[19].data[0] == 5


def quick(rounds):
    """The same questions in the same order, to one Elliptec address, with less patience: answers come at once here."""
    others = ELLIPTEC[:7] + ELLIPTEC[8:]
    return [
        replace(one, questions=[replace(question, reply_s=0.1) for question in one.questions if question not in others])
        for one in rounds
    ]


@pytest.mark.parametrize("family", FAMILIES)
def test_each_family_is_known_by_its_answer(serve, family):
    make, named, _, _ = FAMILIES[family]
    bench = serve()
    port = bench.sim.listen(make([Axis(0.001), Axis(0.001)], Wheel()))
    probed = probe(port, (), quick(rounds_for(port, None)))
    assert [f"{answer.driver} {answer.place}".strip() for answer in probed.answers] == [named]
