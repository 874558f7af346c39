from __future__ import annotations

import pytest

from drivers.rotating_analyzer import RotatingAnalyzer, SlotAngles
from goniometer.errors import (
    ConfigurationError,
    DeviceFaultError,
    LimitError,
    NotConnectedError,
    ReplyTimeoutError,
)


class Mount:
    """An axis that has arrived once `has_arrived` is set."""

    tolerance_deg = 0.1

    def __init__(self, name: str, settle_s: float = 0.1) -> None:
        self.name, self.settle_s = name, settle_s
        self.at_deg = self.target_deg = 0.0
        self.has_arrived = True
        self.polls = self.stops = self.reconnects = 0
        self.refusal: Exception | None = None
        self.cannot_stop: Exception | None = None

    def connect(self) -> tuple[str, ...]:
        return (f"an old error of {self.name}",)

    def reconnect(self) -> None:
        self.reconnects += 1

    def start_move(self, target_deg: float) -> None:
        if self.refusal is not None:
            raise self.refusal
        self.target_deg, self.has_arrived = target_deg, False

    def is_moving(self) -> bool:
        self.polls += 1
        return not self.has_arrived

    def position_deg(self) -> float:
        return self.at_deg

    def stop(self) -> None:
        self.stops += 1
        if self.cannot_stop is not None:
            raise self.cannot_stop

    def arrive(self, error_deg: float = 0.0) -> None:
        self.at_deg, self.has_arrived = self.target_deg + error_deg, True


LINEAR = {number: SlotAngles(45.0 * (number - 1)) for number in (1, 2, 3, 4)}
WITH_RETARDER = {1: SlotAngles(0, 0), 2: SlotAngles(90, 90), 5: SlotAngles(45, 0), 6: SlotAngles(45, 90)}


@pytest.fixture
def polarizer():
    return Mount("polarizer", settle_s=0.2)


@pytest.fixture
def retarder():
    return Mount("retarder")


def test_slot_is_an_angle_of_the_polarizer(polarizer):
    analyzer = RotatingAnalyzer(polarizer, name="analyzer", slots=LINEAR)
    assert (analyzer.name, analyzer.settle_s, analyzer.slot()) == ("analyzer", 0.2, 1)
    analyzer.start_select(4)
    assert polarizer.target_deg == 135.0
    assert analyzer.is_moving()
    polarizer.arrive()
    assert not analyzer.is_moving()
    assert analyzer.slot() == 4


def test_both_axes_start_at_once_and_both_must_arrive(polarizer, retarder):
    analyzer = RotatingAnalyzer(polarizer, retarder, name="analyzer", slots=WITH_RETARDER)
    analyzer.start_select(6)
    assert (polarizer.target_deg, retarder.target_deg) == (45.0, 90.0)
    assert analyzer.is_moving()
    assert (polarizer.polls, retarder.polls) == (1, 1)
    polarizer.arrive()
    assert analyzer.is_moving()
    retarder.arrive()
    assert not analyzer.is_moving()
    assert analyzer.slot() == 6


@pytest.mark.parametrize(("error_deg", "slot"), [(0.099, 2), (-0.099, 2), (360.0, 2), (-719.95, 2)])
def test_slot_is_told_within_the_tolerance_and_whole_turns_aside(polarizer, error_deg, slot):
    analyzer = RotatingAnalyzer(polarizer, name="analyzer", slots=LINEAR)
    analyzer.start_select(2)
    polarizer.arrive(error_deg)
    assert analyzer.slot() == slot


@pytest.mark.parametrize("error_deg", [0.101, -0.101, 180.0, 20.0])
def test_angle_of_no_slot_is_none(polarizer, error_deg):
    analyzer = RotatingAnalyzer(polarizer, name="analyzer", slots=LINEAR)
    analyzer.start_select(2)
    polarizer.arrive(error_deg)
    assert analyzer.slot() is None


def test_retarder_that_lags_is_no_slot(polarizer, retarder):
    analyzer = RotatingAnalyzer(polarizer, retarder, name="analyzer", slots=WITH_RETARDER)
    analyzer.start_select(2)
    polarizer.arrive()
    retarder.arrive(-3.0)
    assert analyzer.slot() is None


def test_slot_that_does_not_exist_moves_nothing(polarizer):
    analyzer = RotatingAnalyzer(polarizer, name="analyzer", slots=LINEAR)
    with pytest.raises(LimitError, match="analyzer: slot 5 does not exist; the analyzer has the slots 1, 2, 3, 4"):
        analyzer.start_select(5)
    assert polarizer.has_arrived


def test_axis_that_has_begun_is_stopped_when_the_other_does_not_begin(polarizer, retarder):
    analyzer = RotatingAnalyzer(polarizer, retarder, name="analyzer", slots=WITH_RETARDER)
    retarder.refusal = DeviceFaultError("retarder", "it has an alarm", not_done="the move", to_do="look")
    with pytest.raises(DeviceFaultError, match="retarder: it has an alarm"):
        analyzer.start_select(2)
    assert polarizer.stops == 1


def test_every_axis_is_stopped_also_when_one_cannot_be(polarizer, retarder):
    analyzer = RotatingAnalyzer(polarizer, retarder, name="analyzer", slots=WITH_RETARDER)
    analyzer.stop()
    polarizer.cannot_stop = ReplyTimeoutError("polarizer", "silence", not_done="the stop", to_do="cut its power")
    with pytest.raises(ReplyTimeoutError, match="polarizer: silence"):
        analyzer.stop()
    retarder.cannot_stop = NotConnectedError("retarder", "it is gone", not_done="the stop", to_do="cut its power")
    with pytest.raises(
        NotConnectedError, match=r"analyzer: polarizer: silence; retarder: it is gone\. .*cut its power"
    ):
        analyzer.stop()
    assert (polarizer.stops, retarder.stops) == (3, 3)


@pytest.mark.parametrize(
    "slots",
    [
        {1: SlotAngles(0), 2: SlotAngles(0.19)},
        {1: SlotAngles(0), 2: SlotAngles(360)},
        {1: SlotAngles(-179.95), 2: SlotAngles(180)},
    ],
)
def test_slots_that_cannot_be_told_apart_are_refused(polarizer, slots):
    with pytest.raises(ConfigurationError, match="analyzer: the slots 1 and 2 have angles that cannot be told apart"):
        RotatingAnalyzer(polarizer, name="analyzer", slots=slots)


def test_slots_with_angles_for_other_axes_are_refused_all_at_once(polarizer, retarder):
    with pytest.raises(
        ConfigurationError, match=r"slot 2 has polarizer_deg and retarder_deg; allowed: polarizer_deg, "
    ):
        RotatingAnalyzer(polarizer, name="analyzer", slots={1: SlotAngles(0), 2: SlotAngles(0, 90)})
    with pytest.raises(ConfigurationError, match="for polarizer and retarder") as caught:
        RotatingAnalyzer(polarizer, retarder, name="analyzer", slots=LINEAR)
    assert len(caught.value.faults) == 4


def test_a_retarder_turns_before_a_polarizer_that_is_fixed(retarder):
    slots = {1: SlotAngles(retarder_deg=-45.0), 2: SlotAngles(retarder_deg=45.0)}
    analyzer = RotatingAnalyzer(retarder=retarder, name="analyzer", slots=slots)
    analyzer.start_select(2)
    retarder.arrive()
    assert retarder.target_deg == 45.0
    assert analyzer.slot() == 2
    with pytest.raises(ConfigurationError, match="slot 1 has polarizer_deg; allowed: retarder_deg, for retarder"):
        RotatingAnalyzer(retarder=retarder, name="analyzer", slots={1: SlotAngles(0.0), 2: slots[2]})


def test_an_analyzer_of_which_nothing_turns_is_refused():
    with pytest.raises(ConfigurationError, match="neither polarizer nor retarder turns"):
        RotatingAnalyzer(name="analyzer", slots={})


def test_every_axis_is_taken_up_again_after_a_lost_link(polarizer, retarder):
    analyzer = RotatingAnalyzer(polarizer, retarder, name="analyzer", slots=WITH_RETARDER)
    analyzer.reconnect()
    assert (polarizer.reconnects, retarder.reconnects) == (1, 1)
    assert analyzer.connect() == ("polarizer: an old error of polarizer", "retarder: an old error of retarder")
