"""Known light comes back from simulated frames with all that a sensor adds, and as well as is stated."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from acquisition.imaging.light.bad_pixels import hot_pixels
from acquisition.imaging.light.corrections import Corrections
from acquisition.imaging.light.dark import Dark
from acquisition.imaging.light.flat import Flat
from acquisition.imaging.light.linearity import Linearity
from acquisition.imaging.light.sensor import Sensor
from acquisition.imaging.stokes.pixel_formula import SensorNoise
from drivers.camera.frame import Frame
from goniometer.errors import ReductionError

SHAPE = (150, 200)
PIXELS = SHAPE[0] * SHAPE[1]
BENT = Linearity([(0, 0), *((read, read * (1 + 0.12 * read / 16_000)) for read in range(250, 16_751, 250))])


@dataclass
class Camera:
    """Charge, dark current, amplifier, curve, converter: as a textbook has them, and in its order."""

    seed: int
    electrons: float = 2.0
    "For a true count at 0 dB."
    black: float = 120.0
    read: float = 2.0
    "In counts at 0 dB, before the converter rounds."
    dark_s: float = 0.0
    "Mean dark current in counts per second at 0 dB."
    linearity: Linearity | None = None
    bits: int = 14

    def __post_init__(self):
        self.random = np.random.default_rng(self.seed)
        self.sensitivity = 1 + 0.1 * np.cos(np.linspace(0, 9, PIXELS)).reshape(SHAPE)
        self.sensitivity *= self.random.normal(1, 0.02, SHAPE)
        self.sensitivity /= self.sensitivity.mean()
        self.offset = self.black + self.random.normal(0, 1.0, SHAPE)
        self.current = self.dark_s * self.random.gamma(4, 0.25, SHAPE)

    @property
    def sensor(self):
        noise = SensorNoise(np.sqrt(self.read**2 + 1 / 12), self.electrons)
        return Sensor(noise, (1 << self.bits) - 100, bits=self.bits, linearity=self.linearity)

    def frame(self, light, exposure_s, gain_db=0.0):
        amplified = 10 ** (gain_db / 20)
        mean = (light * self.sensitivity + self.current) * exposure_s
        true = self.random.poisson(mean * self.electrons) / self.electrons * amplified + self.offset
        read = true if self.linearity is None else np.interp(true, *np.array(self.linearity.table).T[::-1])
        counts = np.rint(read + self.random.normal(0, self.read * amplified, SHAPE))
        return Frame(np.clip(counts, 0, (1 << self.bits) - 1).astype(np.uint16), self.bits, exposure_s, gain_db, 0.0)

    def dark(self, *exposures_s, count=9, gain_db=0.0):
        return Dark(self.sensor, [self.frame(0.0, at, gain_db) for at in exposures_s for _ in range(count)])

    def flat(self, dark, exposure_s, light, count=16):
        frames = [self.frame(light, exposure_s) for _ in range(count)]
        return Flat.of(Corrections(self.sensor, dark).signal(frames))


def assert_honest(found, true):
    """Errors over stated ones have the mean 0 and the standard deviation 1, within 5 of their own sampling errors."""
    pull = ((found.signal - true) / np.sqrt(found.variance))[np.isfinite(found.signal)]
    assert len(pull) > 0.9 * PIXELS
    assert abs(pull.mean()) < 5 / np.sqrt(len(pull))
    assert abs(pull.std() - 1) < 5 / np.sqrt(2 * len(pull))


def ramp(low, high):
    return np.geomspace(low, high, SHAPE[1])[None, :] * np.ones(SHAPE)


def test_nothing_called_for_is_counts_over_exposure():
    camera = Camera(1)
    frame = camera.frame(3_000.0, 0.3)
    found = Corrections(camera.sensor).signal([frame])
    assert_array_equal(found.signal, frame.counts.astype(np.float32) / np.float32(0.3))
    assert found.signal.dtype == found.variance.dtype == np.float32
    assert found.notes == ()
    assert_allclose(found.variance, (4.0 + 1 / 12 + frame.counts / 2.0) / 0.3**2, rtol=1e-6)


def test_the_mean_of_pictures_is_as_good_as_the_pictures():
    camera = Camera(11)
    pictures = [camera.frame(3_000.0, 0.3) for _ in range(5)]
    corrections = Corrections(camera.sensor, camera.dark(0.3))
    apart = corrections.signal(pictures)
    mean = np.rint(np.mean([one.counts for one in pictures], axis=0)).astype(np.uint16)
    together = corrections.signal([replace(pictures[0], counts=mean, averaged=5)])
    assert_allclose(together.signal, apart.signal, atol=0.51 / 0.3)  # its counts are rounded
    assert_allclose(together.variance, apart.variance, rtol=1e-3)


@pytest.mark.parametrize("gain_db", [0.0, 6.0])
def test_light_comes_back_from_one_exposure_with_everything_at_once(gain_db):
    camera = Camera(2, dark_s=40.0, linearity=None if gain_db else BENT)
    dark = camera.dark(0.5, 2.0)
    flat = camera.flat(dark, 0.5, 6_000.0)
    true = ramp(2_000, 6_000)
    if gain_db:
        dark = Dark(camera.sensor, [camera.frame(0.0, at, gain_db) for at in (0.5, 2.0) for _ in range(9)])
    found = Corrections(camera.sensor, dark, flat).signal([camera.frame(true, 0.7, gain_db)])
    assert_honest(found, true)


def test_the_noise_of_the_converter_is_stretched_by_the_table_and_that_of_the_light_is_not():
    twice = Linearity([(0, 0), (16_384, 32_768)])
    for electrons, light in ((0.2, 40_000.0), (50.0, 2_000.0)):  # photons make most of the noise, or little
        camera = Camera(15, electrons=electrons, read=4.0, linearity=twice)
        found = Corrections(camera.sensor, camera.dark(0.5)).signal([camera.frame(light, 0.5)])
        assert_honest(found, light * camera.sensitivity)


@pytest.mark.parametrize("gain_db", [0.0, 12.0])
def test_the_dark_current_has_noise_of_its_own(gain_db):
    camera = Camera(16, electrons=3.0, read=1.0, dark_s=300.0)
    dark = camera.dark(0.5, 2.0, gain_db=gain_db)
    found = Corrections(camera.sensor, dark).signal([camera.frame(20.0, 1.0, gain_db)])
    assert_honest(found, 20.0 * camera.sensitivity)


@pytest.mark.parametrize("apart", [1e-6, 1e-3])
@pytest.mark.parametrize("exposures_s", [(0.2,), (0.2, 0.02)])
def test_exposures_and_gains_as_they_were_applied_are_those_that_were_asked_for(apart, exposures_s):
    """A driver takes a picture that is 0.1 % or 0.005 dB off, and every frame then says something else."""
    camera = Camera(19, electrons=0.5, read=4.0)
    random = np.random.default_rng(4)

    def applied(light, exposure_s):
        off = random.uniform(-1, 1, 2)
        return camera.frame(light, exposure_s * (1 + apart * off[0]), 5.0 * apart * off[1])

    dark = Dark(camera.sensor, [applied(0.0, at) for _ in range(13) for at in exposures_s])
    assert [level.frames for level in dark.levels] == [13] * len(exposures_s)
    found = Corrections(camera.sensor, dark).signal([applied(20_000.0, at) for _ in range(3) for at in exposures_s])
    assert_honest(found, 20_000.0 * camera.sensitivity)


@pytest.mark.parametrize("exposures_s", [(0.5,), (0.5, 0.05), (0.3,)])
def test_the_light_is_right_although_the_black_level_creeps(exposures_s):
    """Dark pictures of 0.5 s and 0.05 s stand between those of the light; none is as dark as their mean."""
    camera = Camera(20, dark_s=10.0)
    at_rest = camera.offset

    def frame(light, exposure_s, time_s):
        camera.offset = at_rest + 0.05 * time_s
        return replace(camera.frame(light, exposure_s), time_s=time_s)

    dark = Dark(camera.sensor, [frame(0.0, at, time_s) for time_s in range(0, 601, 50) for at in (0.5, 0.05)])
    corrections = Corrections(camera.sensor, dark)
    for time_s in (-20.0, 10.0, 333.0, 620.0):
        frames = [frame(2_000.0, at, time_s + after) for after in (0.0, 5.0) for at in exposures_s]
        assert_honest(corrections.signal(frames), 2_000.0 * camera.sensitivity)


def test_a_flat_divides_the_signal_and_its_error_remains_a_share_of_it():
    camera = Camera(17)
    frame = camera.frame(5_000.0, 0.5)
    sensitivity = np.where(ramp(1, 2) < 1.5, 0.5, 1.5).astype(np.float32)
    raw = Corrections(camera.sensor).signal([frame])
    found = Corrections(camera.sensor, flat=Flat(sensitivity, np.full(SHAPE, 0.001, np.float32))).signal([frame])
    assert_allclose(found.signal, raw.signal / sensitivity, rtol=1e-6)
    assert_allclose(found.variance, raw.variance / sensitivity**2 + 0.001 * found.signal**2, rtol=1e-6)


def test_the_common_error_of_the_dark_does_not_average_out_over_repeats():
    camera = Camera(3)
    dark = camera.dark(0.5, count=2)
    found = Corrections(camera.sensor, dark).signal([camera.frame(200.0, 0.5) for _ in range(20)])
    assert_honest(found, 200.0 * camera.sensitivity)
    of_dark = dark.variance(0.5, 0.0).mean() / 0.5**2
    assert of_dark > 0.25 * found.variance.mean()  # it is a good part of the whole, or nothing was shown


def test_light_comes_back_from_merged_exposures_with_everything_at_once():
    camera = Camera(4, dark_s=40.0, linearity=BENT)
    dark = camera.dark(0.05, 2.0)
    flat = camera.flat(dark, 0.5, 6_000.0)
    true = ramp(100, 60_000)
    frames = [camera.frame(true, at) for at in (0.05, 0.4, 0.4, 2.0)]
    found = Corrections(camera.sensor, dark, flat).signal(frames)
    assert_honest(found, true)
    assert not found.notes
    alone = Corrections(camera.sensor, dark, flat).signal([frames[0]])
    assert found.variance[:, :50].mean() < 0.05 * alone.variance[:, :50].mean()


def test_exposures_of_different_gains_are_merged():
    camera = Camera(5, black=300.0)
    dark = Dark(camera.sensor, [camera.frame(0.0, 0.2, gain_db) for gain_db in (0.0, 12.0) for _ in range(9)])
    true = ramp(500, 30_000)
    found = Corrections(camera.sensor, dark).signal([camera.frame(true, 0.2, gain_db) for gain_db in (0.0, 12.0)])
    assert_honest(found, true * camera.sensitivity)


def test_variance_is_honest_at_five_electrons():
    """Single pixels' variances scatter with their counts; their mean is the mean square of the errors."""
    camera = Camera(6, electrons=0.5, read=3.0)
    dark = camera.dark(0.1, count=4)
    true = 100.0 * camera.sensitivity  # 10 counts, 5 electrons
    found = Corrections(camera.sensor, dark).signal([camera.frame(100.0, 0.1)])
    error = found.signal - true
    assert abs(error.mean()) < 5 * error.std() / np.sqrt(PIXELS)
    assert abs(np.mean(error**2) / found.variance.mean() - 1) < 5 * np.sqrt(2 / PIXELS)


def test_merging_is_unbiased_at_few_electrons_where_weights_of_the_noisy_counts_are_not():
    camera = Camera(7, electrons=0.5, read=1.0)
    exposures_s = (0.05, 0.1, 0.2, 0.2)
    dark = camera.dark(*exposures_s[:3], count=50)
    true = 100.0 * camera.sensitivity  # 2.5, 5 and 10 electrons
    frames = [camera.frame(100.0, at) for at in exposures_s]
    corrections = Corrections(camera.sensor, dark)
    found = corrections.signal(frames)
    error = found.signal - true
    tolerance = 5 * error.std() / np.sqrt(PIXELS)
    assert abs(error.mean()) < tolerance
    assert abs(np.mean(error**2) / found.variance.mean() - 1) < 0.05
    singles = [corrections.signal([frame]) for frame in frames]
    weights = np.array([1 / one.variance for one in singles])
    naive = np.sum([one.signal * weight for one, weight in zip(singles, weights, strict=True)], 0) / weights.sum(0)
    assert (naive - true).mean() < -10 * tolerance


def test_merging_is_unbiased_where_the_converter_makes_most_of_the_noise():
    """Weights of a mean by duration alone would shift the result by 0.03 standard deviations."""
    errors = []
    for seed in range(30, 42):
        camera = Camera(seed, electrons=1.0)
        exposures_s = (0.05, 0.2, 0.8)
        dark = camera.dark(*exposures_s, count=60)
        found = Corrections(camera.sensor, dark).signal([camera.frame(2.0, at) for at in exposures_s])
        errors.append(found.signal - 2.0 * camera.sensitivity)
    assert abs(np.mean(errors)) < 5 * np.std(errors) / np.sqrt(np.size(errors))


def test_a_pixel_saturated_in_the_long_exposure_comes_from_the_short_one_and_in_all_is_unknown():
    camera = Camera(8)
    dark = camera.dark(0.1, 1.0)
    true = np.full(SHAPE, 3_000.0)
    true[:20] = 50_000.0
    true[:5] = 400_000.0
    frames = [camera.frame(true, at) for at in (0.1, 1.0)]
    corrections = Corrections(camera.sensor, dark)
    found = corrections.signal(frames)
    short = corrections.signal(frames[:1])
    assert_allclose(found.signal[5:20], short.signal[5:20], rtol=1e-6)
    assert_allclose(found.variance[5:20], short.variance[5:20], rtol=1e-5)
    assert_array_equal(np.isnan(found.signal), true > 100_000)
    assert_array_equal(np.isnan(found.variance), true > 100_000)
    assert corrections.saturated_share(frames[0]) == pytest.approx(5 / 150)
    assert corrections.saturated_share(frames[1]) == pytest.approx(20 / 150)
    bad = np.zeros(SHAPE, bool)
    bad[:10] = True
    assert Corrections(camera.sensor, bad=bad).saturated_share(frames[1]) == pytest.approx(10 / 140)


def test_a_pixel_that_one_repeat_shows_saturated_is_not_made_of_those_that_came_out_low():
    camera = Camera(9)
    frames = [camera.frame(1_000.0, 0.1) for _ in range(2)]
    frames[1].counts[3, 4] = camera.sensor.saturation_counts
    found = Corrections(camera.sensor).signal(frames)
    assert_array_equal(np.argwhere(np.isnan(found.signal)), [[3, 4]])


def test_pixels_whose_exposures_contradict_each_other_are_counted_but_not_those_known_to_be_bad():
    camera = Camera(10)
    dark = camera.dark(0.1, 1.0, count=1)
    frames = [camera.frame(ramp(10, 10_000), at) for at in (0.1, 1.0)]
    corrections = Corrections(camera.sensor, dark)
    assert corrections.signal(frames).notes == ()
    frames[0].counts[40, 20:27] += 60
    bad = np.zeros(SHAPE, bool)
    bad[40, 20:22] = True
    (note,) = corrections.signal(frames).notes
    assert f"7 of {PIXELS} pixels" in note
    (note,) = Corrections(camera.sensor, dark, bad=bad).signal(frames).notes
    assert f"5 of {PIXELS} pixels" in note


def test_errors_of_a_dark_from_few_frames_are_no_contradictions():
    camera = Camera(18)
    dark = camera.dark(0.1, 0.2, count=1)
    frames = [camera.frame(50.0, at) for at in (0.1, 0.2) for _ in range(9)]
    found = Corrections(camera.sensor, dark).signal(frames)
    assert not found.notes
    assert_honest(found, 50.0 * camera.sensitivity)


def test_hot_and_dead_pixels_are_flagged_and_no_others_changed():
    camera = Camera(11, dark_s=20.0)
    camera.current[7, 8] = 3_000.0
    camera.current[9, 9] = 90_000.0
    camera.sensitivity[70, 80] = 0.01
    dark = camera.dark(0.2, 1.0)
    flat = camera.flat(dark, 0.5, 6_000.0)
    bad = hot_pixels(dark)
    assert_array_equal(np.argwhere(bad), [[7, 8], [9, 9]])
    assert_array_equal(np.argwhere(flat.is_bad), [[9, 9], [70, 80]])
    frame = camera.frame(5_000.0, 0.6)
    found = Corrections(camera.sensor, dark, flat, bad).signal([frame])
    assert_array_equal(np.argwhere(np.isnan(found.signal)), [[7, 8], [9, 9], [70, 80]])
    assert_array_equal(np.isnan(found.variance), np.isnan(found.signal))
    open_ended = Corrections(camera.sensor, dark, flat).signal([frame])
    assert_array_equal(found.signal[20:60], open_ended.signal[20:60])


def test_the_result_does_not_depend_on_the_bands_in_which_it_is_made(monkeypatch):
    camera = Camera(12, dark_s=40.0, linearity=BENT)
    dark = camera.dark(0.1, 1.0)
    corrections = Corrections(camera.sensor, dark, camera.flat(dark, 0.5, 6_000.0))
    frames = [camera.frame(ramp(100, 60_000), at) for at in (0.1, 1.0)]
    expected = corrections.signal(frames)
    monkeypatch.setattr("acquisition.imaging.light.corrections._BAND_PIXELS", 7 * SHAPE[1])
    found = corrections.signal(frames)
    assert_array_equal(found.signal, expected.signal)
    assert_array_equal(found.variance, expected.variance)


@pytest.mark.parametrize(
    ("changed", "what"),
    [
        ({"counts": np.zeros((150, 199), np.uint16)}, r"Frame 1 \(number 77 .* has 199 x 150 pixels, not 200 x 150"),
        ({"counts": np.zeros(SHAPE, np.uint8)}, "Frame 1 .* of uint8"),
        ({"bits": 12}, "Frame 1 .* has 12 bits; the sensor's figures hold for 14"),
        ({"exposure_s": 0.0}, "Frame 1 .* exposure or gain that cannot be"),
        ({"gain_db": 6.0}, "Frame 1 .* another gain than the table of linearity, 0 dB"),
    ],
)
def test_frames_of_another_size_depth_or_gain_are_refused_by_name(changed, what):
    camera = Camera(13, linearity=BENT)
    frames = [camera.frame(100.0, 0.1) for _ in range(2)]
    frames[1] = replace(frames[1], number=77, **changed)
    with pytest.raises(ReductionError, match=what):
        Corrections(camera.sensor).signal(frames)


def test_corrections_of_another_size_are_refused():
    camera = Camera(14)
    with pytest.raises(ReductionError, match="dark 200 x 150, bad pixels 8 x 9 pixels"):
        Corrections(camera.sensor, camera.dark(0.1), bad=np.zeros((9, 8), bool))
    small = replace(camera.frame(1.0, 0.1), counts=np.zeros((9, 8), np.uint16))
    with pytest.raises(ReductionError, match=r"Frame 0 .* has 8 x 9 pixels, not 200 x 150"):
        Corrections(camera.sensor, camera.dark(0.1)).signal([small])
    with pytest.raises(ReductionError, match="There is no Frame"):
        Corrections(camera.sensor).signal([])


@pytest.mark.parametrize("linearity", [None, BENT])
def test_without_dark_pictures_the_black_level_that_is_stated_is_subtracted(linearity):
    camera = Camera(8, linearity=linearity)
    black = camera.black if linearity is None else float(np.interp(camera.black, *np.array(BENT.table).T[::-1]))
    frames = [camera.frame(40.0, 0.5)]
    light = Corrections(replace(camera.sensor, black_counts=black)).signal(frames)
    assert_allclose(np.nanmean(light.signal), 40.0, rtol=0.01)
    assert_allclose(np.nanmean(Corrections(camera.sensor).signal(frames).signal), 40.0 + camera.black / 0.5, rtol=0.01)
