"""Skip, pause, exposure and waiting for the lamp, in a scan at several wavelengths."""

from pathlib import Path

import pytest
import yaml
from numpy.testing import assert_allclose, assert_array_equal

import goniometer
from acquisition.control import ScanControl
from acquisition.events import Paused, PointReduced, ReadingStored, ScanDoubted, Skipped, StepStarted, WentOn
from acquisition.suspend import suspensions

ROOT = Path(__file__).resolve().parents[2]
EXITS_DEG = [20, 45, 60, 75]
REFERENCE = {"exit_deg": 60, "every_points": 2}


@pytest.fixture
def run(tmp_path):
    """Runs iron at 580 and 525 nm, the latter first, in four directions; `on` gets every event and the control."""

    def scan(on=lambda event, control: None, out="runs", scene=None, **changes):
        content = yaml.safe_load((ROOT / "scenes" / "iron_filters.yaml").read_text())
        content["rig"] = str(ROOT / "rigs" / "simulated_filters.yaml")
        (tmp_path / "scene.yaml").write_text(yaml.safe_dump(content | (scene or {})))
        recipe = yaml.safe_load((ROOT / "recipes" / "iron_wavelengths.yaml").read_text())
        recipe |= {"rig": content["rig"], "scene": str(tmp_path / "scene.yaml"), "wavelength_nm": [580, 525]}
        recipe |= {"exit_deg": EXITS_DEG, "readings": 2}
        recipe["fit"] = {"lobes": ["specular"], "free": {"sigma": [0.02, 1.0]}, "fixed": {"n": 2.95, "k": 2.93}}
        del recipe["exit"], recipe["reference"]
        (tmp_path / "recipe.yaml").write_text(yaml.safe_dump(recipe | changes))
        control, events = ScanControl(), []

        def see(event):
            events.append(event)
            on(event, control)

        options = {"out": tmp_path / out, "speed": "max", "live_fit": False, "subscribers": [see], "control": control}
        return goniometer.run(tmp_path / "recipe.yaml", **options), events

    return scan


def of(kind, events):
    return [event for event in events if isinstance(event, kind)]


def with_filters(**transmissions):
    """The devices of the scene with other transmissions, by slot."""
    devices = yaml.safe_load((ROOT / "scenes" / "iron_filters.yaml").read_text())["devices"]
    for slot, transmission in transmissions.items():
        devices["filters"]["filters"][int(slot[-1])]["transmission"] = transmission
    return devices


@pytest.mark.parametrize("reference", [{}, {"reference": REFERENCE}], ids=["plain", "with references"])
def test_the_direction_that_begins_a_wavelength_is_skipped_before_its_first_reading(run, reference):
    """Without references, no reading has said yet that the wavelength has changed."""
    begun = []

    def on(event, control):
        if isinstance(event, StepStarted) and event.point < 4 and event.slot != 1 and not begun:
            begun.append(event.point)
            control.skip()

    result, events = run(on, **reference)
    (skipped,) = of(Skipped, events)
    assert skipped.point == begun[0] < 4, "the recipe's first wavelength, which comes second"
    left = [number for number in range(8) if number != skipped.point]
    assert [point.point for point in result.points] == left
    assert sorted(event.stokes_point.point for event in of(PointReduced, events)) == left
    assert [len(one.points) for one in result.spectrum] == [3, 4]
    assert any(f"The rest of point {skipped.point} was skipped" in doubt for doubt in result.doubts)


def test_directions_that_were_skipped_at_one_wavelength_each_are_no_grid(run):
    """As many at each, but others: along one dimension two directions would stand for one."""
    pytest.importorskip("xarray")

    def on(event, control):
        if isinstance(event, ReadingStored) and event.reading.point in (1, 6):
            control.skip()

    result, _ = run(on, direction_within_s=0)
    assert [point.point for point in result.points] == [0, 2, 3, 4, 5, 7]
    loaded = goniometer.load(result.folder)
    assert loaded.stokes_per_sr.dims == ("point", "stokes")
    assert_array_equal(loaded.wavelength_nm, [580.0] * 3 + [525.0] * 3)
    assert_allclose(loaded.exit_deg, [20, 60, 75, 20, 45, 75], atol=0.05)


def test_a_pause_at_the_change_of_the_filter_and_another_exposure_from_there(run):
    asked = []

    def on(event, control):
        if isinstance(event, StepStarted) and event.point < 4 and not asked:
            asked.append(event)
            control.pause()
            control.set_exposure(0.3)
        if isinstance(event, Paused):
            control.go_on()

    result, events = run(on)
    assert len(of(Paused, events)) == len(of(WentOn, events)) == 1
    by_wavelength = {one.wavelength_nm: one.exposure_s for one in result.readings}
    assert by_wavelength == {525.0: 0.03, 580.0: pytest.approx(0.3)}
    assert len(result.points) == 8
    plain, _ = run(out="plain")
    for point, short in zip(result.points, plain.points, strict=True):
        assert_allclose(point.stokes, short.stokes, atol=8 * short.covariance[0, 0] ** 0.5)
        if point.wavelength_nm == 580.0:
            assert point.covariance[0, 0] < short.covariance[0, 0] / 5


def test_a_filter_that_lets_less_through_is_no_lamp_that_fails(run):
    """A third of the light at the second wavelength: each is compared with the first reference behind its filter."""
    scene = {"devices": with_filters(slot_3=0.3)}
    result, events = run(scene=scene, reference=REFERENCE, suspend={"lamp_below": 0.8})
    assert not of(Paused, events)
    assert len(result.points) == 8


def test_a_lamp_that_fails_at_the_second_wavelength_spoils_nothing_of_the_first(run):
    recipe = {"reference": REFERENCE, "suspend": {"lamp_below": 0.8}, "direction_within_s": 0}
    plain, _ = run(out="plain", **recipe)
    references = [one for one in plain.readings if one.kind == "reference" and one.wavelength_nm == 580.0]
    off = {"fault": "lamp_off", "at_s": references[0].time_s + 3.0, "for_s": 20.0}
    result, events = run(scene={"faults": [off]}, **recipe)
    (paused,) = of(Paused, events)
    assert "less than 0.8 (lamp_below)" in paused.why
    (interval,) = suspensions(result.about)
    spoilt = {one.point for one in result.readings if one.kind == "signal" and interval.holds(one.time_s)}
    assert spoilt
    assert spoilt < set(range(4))
    assert {point.point for point in result.points} == set(range(8)) - spoilt
    assert any("(lamp_below)" in doubt for doubted in of(ScanDoubted, events) for doubt in doubted.doubts)
    for point in result.points:
        steady = plain.points[point.point]
        assert_allclose(point.stokes, steady.stokes, atol=8 * steady.covariance[0, 0] ** 0.5)
