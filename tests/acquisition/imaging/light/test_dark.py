"""Dark of exposures between dark frames, as well as it is known; and frames that are not dark."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from acquisition.imaging.light.bad_pixels import hot_pixels, masked_pixels
from acquisition.imaging.light.dark import Dark
from acquisition.imaging.light.linearity import Linearity
from acquisition.imaging.light.sensor import Sensor
from acquisition.imaging.stokes.pixel_formula import SensorNoise
from drivers.camera.frame import Frame
from drivers.camera.frame_sum import FrameSum
from goniometer.errors import ReductionError

SENSOR = Sensor(SensorNoise(np.sqrt(2.0**2 + 1 / 12), 1.5), 4_000, bits=12)
SHAPE = (90, 120)
RANDOM = np.random.default_rng(21)
RATE = RANDOM.uniform(20, 60, SHAPE)
OFFSET = RANDOM.uniform(60, 90, SHAPE)


def frame(exposure_s, *, gain_db=0.0, light=0.0):
    electrons = RANDOM.poisson((RATE + light) * exposure_s * 1.5)
    counts = np.rint(electrons / 1.5 + OFFSET + RANDOM.normal(0, 2.0, SHAPE))
    return Frame(counts.astype(np.uint16), 12, exposure_s, gain_db, 5.0)


def flat_frame(counts, exposure_s):
    return Frame(np.full((4, 5), counts, np.uint16), 12, exposure_s, 0.0, 0.0)


def assert_honest(dark, exposure_s):
    pull = (dark.counts(exposure_s, 0.0) - OFFSET - RATE * exposure_s) / np.sqrt(dark.variance(exposure_s, 0.0))
    assert abs(pull.mean()) < 5 / np.sqrt(pull.size)
    assert abs(pull.std() - 1) < 5 / np.sqrt(2 * pull.size)


def test_a_dark_of_the_same_exposure_is_the_mean_of_its_frames_and_no_other():
    frames = [frame(0.5) for _ in range(3)]
    dark = Dark(SENSOR, [*frames, frame(2.0)])
    assert_allclose(dark.counts(0.5, 0.0), np.mean([one.counts for one in frames], axis=0), rtol=1e-6)
    assert_array_equal(dark.counts(0.5002, 0.0), dark.counts(0.5, 0.0))


@pytest.mark.parametrize("exposure_s", [0.01, 0.1, 0.7, 2.0])
def test_darks_between_and_below_exposures_are_as_good_as_stated(exposure_s):
    dark = Dark(SENSOR, [frame(at) for at, count in ((0.1, 6), (1.0, 3), (2.0, 4)) for _ in range(count)])
    assert_honest(dark, exposure_s)


def test_a_dark_between_exposures_lies_on_the_line_through_them():
    dark = Dark(SENSOR, [flat_frame(100, 1.0), flat_frame(110, 3.0)])
    assert_allclose(dark.counts(2.5, 0.0), 107.5, rtol=1e-6)
    assert_allclose(dark.rate(0.0), 5.0, rtol=1e-6)


def test_exposures_with_more_frames_draw_the_line_nearer():
    frames = [
        flat_frame(counts, at)
        for at, counts, count in ((1.0, 100, 1), (2.0, 104, 7), (3.0, 104, 1))
        for _ in range(count)
    ]
    slope, offset = np.polyfit([1.0, 2.0, 3.0], [100, 104, 104], 1, w=np.sqrt([1, 7, 1]))
    assert_allclose(Dark(SENSOR, frames).counts(2.5, 0.0), offset + 2.5 * slope, rtol=1e-6)


def test_dark_frames_are_set_right_by_the_table_of_linearity_as_all_frames_are():
    bent = Sensor(SENSOR.noise, 4_000, bits=12, linearity=Linearity([(0, 0), (100, 100), (200, 300), (4_000, 9_000)]))
    dark = Dark(bent, [flat_frame(150, 1.0)])
    assert_allclose(dark.counts(1.0, 0.0), 200.0)
    assert_allclose(dark.variance(1.0, 0.0), 4 * (4.0 + 1 / 12), rtol=1e-5)


def test_a_bent_curve_of_the_sensor_is_no_light():
    bent = Sensor(SENSOR.noise, 4_000, bits=12, linearity=Linearity([(0, 0), (100, 100), (200, 1_100), (4_000, 9_000)]))
    frames = [flat_frame(50, 1.0), flat_frame(150, 12.0), flat_frame(200, 22.0)]
    assert_allclose(Dark(bent, frames).rate(0.0), 50.0, rtol=1e-5)
    with pytest.raises(ReductionError, match="do not rise with the exposure along a line"):
        Dark(SENSOR, frames)


@pytest.mark.parametrize(("exposure_s", "gain_db"), [(2.5, 0.0), (1.0, 6.0)])
def test_an_exposure_or_gain_that_no_dark_fits_is_refused(exposure_s, gain_db):
    dark = Dark(SENSOR, [frame(0.5), frame(2.0)])
    with pytest.raises(ReductionError, match=r"No dark fits .* dark frames were taken of 0.5 s at 0 dB, 2 s at 0 dB"):
        dark.counts(exposure_s, gain_db)


def test_one_exposure_says_nothing_of_another():
    with pytest.raises(ReductionError, match=r"No dark fits an exposure of 0.4 s at 0 dB"):
        Dark(SENSOR, [frame(0.5)]).counts(0.4, 0.0)


def test_a_dark_frame_that_light_fell_on_is_named():
    frames = [frame(0.5), frame(0.5), frame(0.5, light=60.0), frame(0.5)]
    with pytest.raises(ReductionError, match=r"Dark frame 2 \(0.5 s, .* light fell on it"):
        Dark(SENSOR, frames)


@pytest.mark.parametrize("lit", [0, 1, 2])
def test_light_on_one_exposure_bends_the_line(lit):
    frames = [frame(at, light=100.0 / at * (place == lit)) for place, at in enumerate((0.5, 1.0, 2.0))]
    with pytest.raises(ReductionError, match=r"counts at 0.5 s, .* counts at 1 s, .* counts at 2 s\. Light fell on"):
        Dark(SENSOR, frames)


def creeping(*, lit=None, count=40, step):
    """Dark pictures, one each 10 s, whose level creeps by many read noises in all."""
    frames = [frame(0.5, light=60.0 * (place == lit)) for place in range(count)]
    crept = [np.uint16(step * place - min(step * count, 0)) for place in range(count)]
    return [
        replace(one, counts=one.counts + more, time_s=10.0 * place)
        for place, (one, more) in enumerate(zip(frames, crept, strict=True))
    ]


@pytest.mark.parametrize("step", [2.0, 15.0, -1.0])
def test_a_level_that_creeps_is_no_light_and_is_known_at_every_time(step):
    frames = creeping(step=step)
    (level,) = Dark(SENSOR, [frames[place] for place in np.random.default_rng(1).permutation(len(frames))]).levels
    middle = (len(frames) - 1) / 2
    for place in (0.0, 1.0, 2.5, len(frames) - 1.0, -0.5, len(frames) - 0.5):
        assert level.drift.counts(10.0 * place) == pytest.approx(step * (place - middle), abs=0.2)


@pytest.mark.parametrize("step", [0.0, 1.0, 15.0])
@pytest.mark.parametrize("lit", [0, 7, 39])
def test_light_on_one_of_many_frames_whose_level_creeps_is_found(lit, step):
    with pytest.raises(ReductionError, match=rf"Dark frame {lit} \(0.5 s, .* light fell on it"):
        Dark(SENSOR, creeping(lit=lit, step=step))


def test_a_drift_that_ends_in_a_pause_of_a_night_is_no_light():
    frames = creeping(count=20, step=2.0)
    (level,) = Dark(SENSOR, [*frames[:10], *(replace(one, time_s=one.time_s + 40_000.0) for one in frames[10:])]).levels
    assert level.drift.counts(40_100.0) - level.drift.counts(90.0) == pytest.approx(2.0, abs=0.2)


@pytest.mark.parametrize("pause_s", [10.0, 3600.0])
def test_a_level_that_has_jumped_in_a_pause_is_another_one_from_then_on(pause_s):
    frames = creeping(count=12, step=0.0)
    jumped = [replace(one, counts=one.counts + np.uint16(60), time_s=one.time_s + pause_s) for one in frames[6:]]
    if pause_s < 600.0:
        with pytest.raises(ReductionError, match="light fell on it, or else the black level jumped"):
            Dark(SENSOR, [*frames[:6], *jumped])
        return
    (level,) = Dark(SENSOR, [*frames[:6], *jumped]).levels
    found = [level.drift.counts(time_s) for time_s in (-5.0, 25.0, jumped[0].time_s, jumped[-1].time_s + 5.0)]
    assert_allclose(found, [-30.0, -30.0, 30.0, 30.0], atol=0.2)
    assert level.drift.counts(jumped[0].time_s - 5.0) == pytest.approx(30.0, abs=0.3), "soon after it went on"


def test_a_level_that_stands_still_does_not_drift():
    frames = [replace(flat_frame(100, 1.0), time_s=float(place)) for place in range(5)]
    frames[2].counts[0, :2] = 3_000
    (level,) = Dark(SENSOR, frames).levels
    assert [level.drift.counts(time_s) for time_s in (-1.0, 0.0, 2.0, 2.5, 9.0)] == [0.0] * 5


def test_drift_is_known_far_better_than_to_a_count():
    """Levels that creep by a fifth of a count show in whole counts of pixels that have some noise."""
    steps = 0.2 * np.arange(6)
    frames = [
        Frame(np.rint(OFFSET + step + RANDOM.normal(0, 2.0, SHAPE)).astype(np.uint16), 12, 0.5, 0.0, step)
        for step in steps
    ]
    (level,) = Dark(SENSOR, frames).levels
    stderr = 2.0 / np.sqrt(OFFSET.size)
    assert_allclose([level.drift.counts(step) for step in steps], steps - steps.mean(), atol=4 * stderr)


@pytest.mark.parametrize("pictures", [1, 3])
def test_drift_shows_in_counts_that_come_in_large_steps(pictures):
    """Pictures of 8 bits with little noise: where a level creeps, few pixels are another step of 257 counts up."""
    noise, times_s = 0.25, np.arange(8.0)
    sensor = Sensor(SensorNoise(257 * np.hypot(noise, 1 / np.sqrt(12)), 0.2), 65_535)
    frames = []
    for time_s in times_s:
        total = FrameSum()
        for _ in range(pictures):
            total.add(np.rint(10.1 + 0.05 * time_s + RANDOM.normal(0, noise, SHAPE)).astype(np.uint8))
        frames.append(Frame(total.mean_counts(), 16, 0.04, 0.0, time_s, averaged=pictures))
    frames[-1].counts[:2] = 60_000
    (level,) = Dark(sensor, frames).levels
    means = np.array([one.counts[2:].mean() for one in frames])
    assert_allclose([level.drift.counts(time_s) for time_s in times_s], means - means.mean(), atol=1.0)


def test_a_short_dark_brighter_than_a_long_one_is_not_dark():
    with pytest.raises(ReductionError, match="do not rise"):
        Dark(SENSOR, [frame(0.5, light=300.0), frame(1.0)])


def test_a_few_hot_pixels_are_no_light():
    frames = [frame(0.5) for _ in range(3)]
    for one in frames:
        one.counts[:5, :20] = 3_000
    assert np.count_nonzero(hot_pixels(Dark(SENSOR, frames))) == 100


def test_a_pixel_saturated_in_any_dark_is_unknown_in_all_and_hot():
    frames = [frame(0.5), frame(2.0)]
    frames[1].counts[3, 4] = 4_000
    dark = Dark(SENSOR, frames)
    assert_array_equal(np.argwhere(np.isnan(dark.counts(0.5, 0.0))), [[3, 4]])
    assert_array_equal(np.argwhere(hot_pixels(dark)), [[3, 4]])


def test_darks_of_which_all_pixels_are_saturated_are_refused():
    with pytest.raises(ReductionError, match="Every pixel is saturated in a dark frame"):
        Dark(SENSOR, [flat_frame(4_050, 1.0)])


def test_the_noise_of_the_dark_current_is_a_pixels_own_only_where_it_stands_out():
    frames = [frame(0.5), frame(1.0)]
    frames[1].counts[7, 8] = 2_000
    rate = Dark(SENSOR, frames).rate(0.0)
    assert rate[7, 8] == pytest.approx(2.0 * (2_000.0 - frames[0].counts[7, 8]), rel=1e-5)
    assert_allclose(rate[0, 0], 40, atol=2)
    assert np.mean(rate == rate[0, 0]) > 0.9


def test_a_quiet_sensor_whose_pixels_mostly_agree_has_no_hot_ones_for_it():
    frames = [flat_frame(100, 0.5)]
    frames[0].counts[0, 0] = 110
    frames[0].counts[0, 1] = 180
    assert_array_equal(np.argwhere(hot_pixels(Dark(SENSOR, frames))), [[0, 1]])


def test_a_mask_is_a_gray_picture(tmp_path):
    cv2 = pytest.importorskip("cv2")
    mask = np.zeros((6, 7), np.uint8)
    mask[2, 3], mask[5, 6] = 255, 1
    (tmp_path / "mask.png").write_bytes(cv2.imencode(".png", mask)[1].tobytes())
    assert_array_equal(masked_pixels(tmp_path / "mask.png"), mask > 0)
    (tmp_path / "colour.png").write_bytes(cv2.imencode(".png", np.dstack([mask] * 3))[1].tobytes())
    (tmp_path / "text.png").write_text("0 0 1")
    (tmp_path / "cut.png").write_bytes((tmp_path / "mask.png").read_bytes()[:20])
    for name in ("colour.png", "text.png", "cut.png"):
        with pytest.raises(ReductionError, match=f"{name} is no mask of bad pixels"):
            masked_pixels(tmp_path / name)
