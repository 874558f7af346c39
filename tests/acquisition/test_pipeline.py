"""What the readings of a scan become on their way, and what is said when nobody knows how bright the lamp was."""

import pytest

from acquisition.events import PointReduced, ReadingStored, ScanDoubted, ScanEnded, WentOn
from acquisition.lamp_level import LampBreak
from acquisition.pipeline import Pipeline
from acquisition.readings import Reading
from acquisition.reduce import NoiseModel, Radiometry, Reduction
from goniometer.errors import ReductionError

DARK_W, SCALE_W = 2e-10, 1e-8
NOISE = NoiseModel(read_w=2e-11, sample_s=0.003, shot=True, wavelength_nm=550)


class Scan:
    """A pipeline that is fed direction by direction, in a lamp of some level, 10 s each; hears what it tells."""

    def __init__(self):
        self.told, self._now_s, self._point = [], 0.0, -1
        reduction = Reduction(Radiometry(1e-4, 1e-4), NOISE, has_dark=True)
        self.pipeline = Pipeline(reduction, None, [self.told.append])

    def _read(self, kind, power_w, analyzer_deg=None, repeat=0):
        self._now_s += 1.0
        place = (self._point, kind, repeat, self._now_s, 60.0, 0.0, 0.0, 2, analyzer_deg, 0.03)
        self.pipeline.publish(ReadingStored(Reading(*place, power_w)))

    def reference(self, level):
        for repeat in range(2):
            self._read("reference", DARK_W + 3e-8 * level, repeat=repeat)

    def direction(self, level, reference=None, s0=1.0):
        self._point += 1
        if reference is not None:
            self.reference(reference)
        for analyzer_deg in (0.0, 60.0, 120.0):
            self._read("signal", DARK_W + SCALE_W * s0 * level / 2, analyzer_deg)
        self._read("dark", DARK_W)

    def end(self):
        self.pipeline.publish(ScanEnded("finished", 0, self._now_s, as_asked=True))
        return [event.doubts for event in self.told if isinstance(event, ScanDoubted)]

    @property
    def s0(self):
        return [event.stokes_point.stokes[0] for event in self.told if isinstance(event, PointReduced)]


def test_a_scan_in_a_steady_lamp_has_nothing_to_be_doubted():
    scan = Scan()
    for point in range(4):
        scan.direction(1.0, reference=1.0 if point % 2 == 0 else None)
        if point == 3:
            scan.reference(1.0)
        scan.pipeline.end_point()
    assert scan.s0 == pytest.approx([1.0] * 4)
    assert scan.end() == []


def test_a_lamp_that_goes_off_ends_the_scan_at_the_next_reference():
    scan = Scan()
    scan.direction(1.0, reference=1.0)
    scan.pipeline.end_point()
    scan.direction(0.0)
    scan.pipeline.end_point()
    scan.direction(0.0, reference=0.0)
    with pytest.raises(ReductionError, match=r"At points 0 to 2 \(9 readings\) the lamp .* one shows no light"):
        scan.pipeline.end_point()
    assert len(scan.s0) == 2, "nothing is made of the direction behind the dark reference"


def test_a_lamp_that_goes_off_in_the_last_directions_is_seen_by_the_reference_that_closes_the_scan():
    """It may come with the last direction, or by itself when a scan decides as it goes that it has ended."""
    for by_itself in (False, True):
        scan = Scan()
        scan.direction(1.0, reference=1.0)
        scan.pipeline.end_point()
        scan.direction(0.0)
        if by_itself:
            scan.pipeline.end_point()
        scan.reference(0.0)
        with pytest.raises(ReductionError, match="one shows no light"):
            scan.pipeline.end_point()


def test_a_reference_that_closes_a_scan_by_itself_makes_no_point():
    scan = Scan()
    scan.direction(1.0, reference=1.0)
    scan.pipeline.end_point()
    scan.reference(1.0)
    scan.pipeline.end_point()
    assert len(scan.pipeline.points) == 1
    assert scan.end() == []


def test_a_scan_cut_short_says_what_no_reference_has_closed_before_it_says_that_it_ended():
    scan = Scan()
    scan.direction(1.0, reference=1.0)
    scan.pipeline.end_point()
    ((doubt,),) = scan.end()
    assert doubt.startswith("No reference was read after point 0:")
    assert [type(event) for event in scan.told[-2:]] == [ScanDoubted, ScanEnded]


def test_a_scan_without_light_and_without_references_ends_with_a_warning():
    scan = Scan()
    for _ in range(3):
        scan.direction(0.0)
        scan.pipeline.end_point()
    ((doubt,),) = scan.end()
    assert doubt.startswith("No light was seen")


def test_a_scan_that_ends_in_a_dark_first_reference_still_ends():
    scan = Scan()
    scan.direction(0.0, reference=0.0)
    with pytest.raises(ReductionError, match="first reference reading shows no light"):
        scan.pipeline.end_point()
    assert scan.end() == []


def test_directions_are_reduced_as_they_are_completed_wherever_they_began():
    """Swept: three directions in each slot, forth and back, and a reference before, whose dark reading comes last."""
    scan = Scan()
    scan._point = 0
    scan.reference(1.0)
    levels = {0: 1.0, 1: 0.5, 2: 0.25}
    sweeps = [(0.0, (0, 1, 2)), (60.0, (2, 1, 0)), (120.0, (0, 1, 2)), (None, (2, 1, 0))]
    for analyzer_deg, points in sweeps:
        for scan._point in points:
            power_w = SCALE_W * levels[scan._point] / 2 if analyzer_deg is not None else 0.0
            scan._read("signal" if analyzer_deg is not None else "dark", DARK_W + power_w, analyzer_deg)
            if analyzer_deg is None:
                scan.pipeline.end_point()
    assert [point.point for point in scan.pipeline.points] == [2, 1, 0]
    assert scan.s0 == pytest.approx([0.25, 0.5, 1.0])


def test_a_lamp_that_is_off_and_on_again_between_two_references_is_told_of_at_the_end():
    scan = Scan()
    for point in range(5):
        scan.direction(0.0 if point == 2 else 1.0, reference=1.0 if point == 0 else None)
        if point == 4:
            scan.reference(1.0)
        scan.pipeline.end_point()
    (doubts,) = scan.end()
    assert len(doubts) == 1
    assert doubts[0].startswith("The readings of point 2 show less than a tenth of the light")


def test_references_far_apart_in_a_long_scan_change_nothing():
    scan = Scan()
    for point in range(300):
        level = 1.0 + 2e-4 * point
        scan.direction(level, reference=level if point % 3 == 0 else None)
        if point == 299:
            scan.reference(level)
        scan.pipeline.end_point()
    assert scan.s0 == pytest.approx([1.0] * 300, rel=1e-3)
    assert scan.end() == []


def test_a_direction_in_an_interval_of_suspension_is_taken_out_again_and_named():
    """The second one was read in half the light, which only the reference behind it shows."""
    scan = Scan()
    for level, reference in ((1.0, 1.0), (1.0, 1.0), (0.5, None)):
        scan.direction(level, reference)
        scan.pipeline.end_point()
    last_good_s = 8.0
    scan.pipeline.publish(WentOn("it is over", 8.5, LampBreak(last_good_s, 16.5, "the lamp was too weak")))
    assert [point.point for point in scan.pipeline.points] == [0]
    scan.direction(1.0)
    scan.reference(1.0)
    scan.pipeline.end_point()
    assert [point.point for point in scan.pipeline.points] == [0, 3]
    ((doubt,),) = scan.end()
    assert doubt.startswith("At points 1 to 2 (6 readings) the lamp level cannot be followed: the lamp was too weak")
