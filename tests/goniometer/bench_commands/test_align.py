"""`goniometer align` finds the zero of an arm, with the right sign, and stores it where it belongs."""

import itertools
import math
import stat
import sys
from datetime import UTC, datetime, timedelta

import pytest
import yaml
from numpy.testing import assert_allclose

from goniometer.bench_commands.align import advice, align
from goniometer.bench_commands.measuring import take_reading_w
from goniometer.bench_commands.move import move
from goniometer.bench_commands.rewritten_rig import MeasuredZero, store_zero, with_zero
from goniometer.errors import CollisionError, ConfigurationError, DeviceFaultError, FitError, LimitError
from goniometer.load_files import load_rig

OTHER = {"source_arm": "detector_arm", "detector_arm": "source_arm"}
NOON = "2026-01-31T12:00:00+00:00"
PLAIN = "velocity_deg_s: 1, acceleration_deg_s2: 1, settle_s: 0, tolerance_deg: 1"
FLOW = f"""\
rig: bench   # ours
devices:
  arms:
    driver: newport_esp301
    port: /dev/ttyUSB0
    axes:
      source_arm: {{axis: 1, limits_deg: [-5, 90], {PLAIN}}}  # s
      detector_arm:              # d
        # its connector
        axis: 2
        limits_deg: [-85, 85]    # never beyond
        velocity_deg_s: 1
        acceleration_deg_s2: 1
        settle_s: 0
        tolerance_deg: 1
      sample_azimuth: {{zero_deg: 0.25, axis: 3, limits_deg: [-5, 90], {PLAIN}}}
  wheel: {{driver: thorlabs_fw102c, port: COM3, slots: {{1: 0, 2: 45, 3: 90, 4: 135, 5: open, 6: blocked}}, slot_s: 1,
          settle_s: 0}}
  meter: {{driver: thorlabs_pm100, port: COM4, sample_s: 0.003, noise: {{read_w: 1.0e-9, shot: true}}}}
calibration: {{beam_power_w: 1, acceptance_sr: 1.0e-4}}
"""


def aligned(bench, arm, told, *, store=False, at=30.0, half_deg=5.0, step_deg=None):
    move(bench.rig, OTHER[arm], at, told.append, told.append)
    return align(bench.rig, arm, at - half_deg, at + half_deg, step_deg, told.append, store=store)


@pytest.mark.parametrize("arm", ["detector_arm", "source_arm"])
@pytest.mark.parametrize("wrong_deg", [-1.3, 0.7])
def test_a_zero_that_is_wrong_in_the_rig_file_is_found_and_stored(serve, told, arm, wrong_deg):
    bench = serve()
    bench.change_axis(arm, zero_deg=wrong_deg)
    found = aligned(bench, arm, told, store=True)
    assert abs(found.zero_deg) < 3 * found.uncertainty_deg < 0.05
    assert_allclose(found.peak.centre_deg, 30 - wrong_deg, atol=0.02)
    assert load_rig(bench.rig).axes()[arm].zero_deg == pytest.approx(found.zero_deg, abs=1e-5)
    assert f"whose zero_deg was {wrong_deg:g}" in advice(found, bench.rig)
    stored = load_rig(bench.rig).axes()[arm]
    assert_allclose(stored.zero_stderr_deg, found.uncertainty_deg, atol=1e-5)
    assert abs(datetime.now(UTC) - datetime.fromisoformat(stored.zero_measured)) < timedelta(minutes=10)
    again = aligned(bench, arm, told)
    assert_allclose(again.peak.centre_deg, 30, atol=0.001)
    assert_allclose(again.zero_deg, found.zero_deg, atol=0.001)


@pytest.mark.parametrize("arm", ["detector_arm", "source_arm"])
def test_an_arm_that_stands_off_its_scale_gets_the_zero_that_sets_it_right(serve, told, arm):
    """The arm stands at 0.4 degrees where its controller says 0, so it is at 0 where the controller says -0.4."""
    bench = serve(effects=[{"effect": "zero_offset", "axis": arm, "offset_deg": 0.4}])
    found = aligned(bench, arm, told, store=True)
    assert_allclose(found.zero_deg, -0.4, atol=3 * found.uncertainty_deg)
    move(bench.rig, arm, 30, told.append, told.append)
    now_s = bench.sim.clock.now()
    assert_allclose(bench.sim.world.angle_deg[arm](now_s), 30, atol=0.02)


def test_the_uncertainty_holds_the_standing_arms_tolerance_and_the_mirrors_roughness(serve, told):
    bench = serve()
    upright = aligned(bench, "detector_arm", told, at=0.0)
    assert_allclose(upright.uncertainty_deg, math.hypot(upright.peak.uncertainty_deg, 0.005 / math.sqrt(3)), rtol=1e-6)
    oblique = aligned(bench, "detector_arm", told, at=60.0)
    # slopes of 0.01 turn reflections by 0.02: a lobe so wide is shifted by up to its variance times tan 60°
    rough_deg = math.degrees(0.02**2 * math.tan(math.radians(60)))
    assert_allclose(oblique.uncertainty_deg, math.hypot(0.005 / math.sqrt(3), rough_deg), rtol=0.05)


def test_without_store_the_rig_file_is_left_as_it_is(serve, told):
    bench = serve()
    before = bench.rig.read_bytes()
    found = aligned(bench, "detector_arm", told)
    assert bench.rig.read_bytes() == before
    assert "Nothing was stored" in advice(found, bench.rig)
    assert not found.stored


def test_light_goes_through_the_open_slot(serve, told):
    bench = serve()
    found = aligned(bench, "detector_arm", told)
    assert any("through slot 1 (open)" in line for line in told)
    assert len(found.scan) == 41


@pytest.mark.parametrize(
    ("slots", "through"),
    [
        ({1: "blocked", 2: 0, 3: 45, 4: 90, 5: 135, 6: "open"}, "slot 6 (open)"),
        ({1: "blocked", 2: 30, 3: 0, 4: 45, 5: 90, 6: 135}, "slot 2 (30.0)"),
    ],
)
def test_light_goes_through_an_open_slot_wherever_it_is_else_through_a_polarizer(serve, told, slots, through):
    wheel = {"analyzer": {"type": "thorlabs_fw102c", "slots": slots}}
    bench = serve(devices=wheel)
    bench.change_rig(lambda rig: rig["devices"]["analyzer"].update(slots=slots))
    aligned(bench, "detector_arm", told, half_deg=3, step_deg=0.5)
    assert any(f"through {through}" in line for line in told)


def test_the_spread_of_a_points_three_readings_is_that_of_the_light_not_of_the_sample_of_three(
    serve, told, monkeypatch
):
    """Readings 1 % below, at and 1 % above their mean come from light that varies by 1 %."""
    factors = itertools.cycle([0.99, 1.0, 1.01])
    monkeypatch.setattr(
        "goniometer.bench_commands.align.take_reading_w",
        lambda opened, exposure_s: next(factors) * take_reading_w(opened, exposure_s),
    )
    found = aligned(serve(), "detector_arm", told, half_deg=3, step_deg=0.5)
    brightest = max(found.scan, key=lambda point: point[1])
    assert_allclose(brightest[2] / brightest[1], 0.01, rtol=0.03)


def test_a_rough_sample_is_no_mirror(serve, told):
    """Its peak is wide, not symmetric and not in the mirror direction: the zero would be wrong by degrees."""
    bench = serve(scene={"sample": {"material": "Fe", "sigma": 0.1764, "rho_s": 0.7, "rho_d": 0.1, "rho_dd": 0.05}})
    with pytest.raises(FitError, match=r"not symmetric|at the edge|no peak with both sides"):
        aligned(bench, "detector_arm", told, at=60, half_deg=24)
    assert not bench.is_moving()


def test_a_scan_that_misses_the_mirror_direction_moves_nothing(serve, told):
    bench = serve()
    with pytest.raises(ConfigurationError, match=r"stands at 0\.0000 degrees, so the mirror direction is there too"):
        align(bench.rig, "detector_arm", 10, 20, None, told.append, store=False)
    assert bench.motor_deg("detector_arm") == 0


def test_a_scan_beyond_the_limits_moves_nothing(serve, told):
    bench = serve()
    with pytest.raises(LimitError, match="target 100 degrees"):
        align(bench.rig, "detector_arm", -10, 100, None, told.append, store=False)
    assert bench.motor_deg("detector_arm") == 0


def test_a_scan_through_a_zone_moves_nothing(serve, told):
    bench = serve(zones=[{"detector_arm": [4, 6]}])
    with pytest.raises(CollisionError, match="enters a collision zone"):
        align(bench.rig, "detector_arm", -10, 10, None, told.append, store=False)
    assert bench.motor_deg("detector_arm") == 0


@pytest.mark.parametrize(("ends", "step_deg"), [((5, -5), None), ((-5, 5), 4.0), ((-5, 5), 0.001)])
def test_a_scan_that_makes_no_sense_is_refused(serve, told, ends, step_deg):
    with pytest.raises(ConfigurationError, match="Nothing was moved"):
        align(serve().rig, "detector_arm", *ends, step_deg, told.append, store=False)


def test_a_saturated_detector_ends_the_scan(serve, told, monkeypatch):
    def saturated(self):
        raise DeviceFaultError("meter", "the detector was saturated", not_done="the reading", to_do="weaken the beam")

    bench = serve()
    monkeypatch.setattr("drivers.thorlabs_pm100.meter.ThorlabsPm100.power_w", saturated)
    with pytest.raises(DeviceFaultError, match="saturated"):
        aligned(bench, "detector_arm", told)
    assert not bench.is_moving()


@pytest.mark.parametrize("line_end", ["\n", "\r\n"])
@pytest.mark.parametrize("mark", [b"", b"\xef\xbb\xbf"])
@pytest.mark.parametrize("role", ["source_arm", "detector_arm", "sample_azimuth"])
def test_only_the_zero_changes_in_the_rig_file(tmp_path, role, line_end, mark):
    path = tmp_path / "rig.yaml"
    path.write_bytes(mark + FLOW.replace("\n", line_end).encode())
    before = load_rig(path)
    store_zero(path, role, MeasuredZero(-0.123456, 0.004, NOON))
    after = load_rig(path)
    axis = after.axes()[role]
    assert (axis.zero_deg, axis.zero_stderr_deg, axis.zero_measured) == (-0.12346, 0.004, NOON)
    assert {name: axis.zero_deg for name, axis in after.axes().items() if name != role} == {
        name: axis.zero_deg for name, axis in before.axes().items() if name != role
    }
    content = path.read_bytes()
    assert content.startswith(mark)
    assert content.count(b"\n") == content.count(line_end.encode())
    changed = content.removeprefix(mark).decode().replace(line_end, "\n")
    for key, value in (("zero_stderr_deg", "0.00400"), ("zero_measured", f"'{NOON}'"), ("zero_deg", "-0.12346")):
        assert f"{key}: {value}" in changed
        changed = changed.replace(f"{key}: {value}, ", "").replace(f"        {key}: {value}\n", "")
    assert changed.replace("{axis: 3", "{zero_deg: 0.25, axis: 3") == FLOW


@pytest.mark.skipif(sys.platform == "win32", reason="modes of this kind exist on POSIX only")
def test_a_stored_file_keeps_its_mode_and_what_a_link_leads_to(tmp_path):
    path, link = tmp_path / "rig.yaml", tmp_path / "link.yaml"
    path.write_text(FLOW)
    path.chmod(0o640)
    link.symlink_to(path)
    store_zero(link, "source_arm", MeasuredZero(1.0, 0.1, NOON))
    assert link.is_symlink()
    assert stat.S_IMODE(path.stat().st_mode) == 0o640
    assert load_rig(path).axes()["source_arm"].zero_deg == 1.0
    assert sorted(file.name for file in tmp_path.iterdir()) == ["link.yaml", "rig.yaml"]


def test_a_file_that_would_mean_anything_else_is_left_as_it_is(tmp_path, monkeypatch):
    monkeypatch.setattr(
        "goniometer.bench_commands.rewritten_rig.with_zero", lambda text, *_: text.replace("[-85, 85]", "[-86, 85]")
    )
    path = tmp_path / "rig.yaml"
    path.write_text(FLOW)
    with pytest.raises(ConfigurationError, match=r"Write these keys of source_arm: zero_deg: 1\.00000, zero_stderr"):
        store_zero(path, "source_arm", MeasuredZero(1.0, 0.1, NOON))
    assert path.read_text() == FLOW
    assert list(tmp_path.iterdir()) == [path]


def test_a_value_on_a_line_of_its_own_is_replaced():
    text = FLOW.replace("        settle_s: 0\n", "        settle_s: 0\n        zero_deg:  # old\n          3\n")
    changed = with_zero(text, "detector_arm", MeasuredZero(2.0, 0.1, NOON))
    assert yaml.safe_load(changed)["devices"]["arms"]["axes"]["detector_arm"]["zero_deg"] == 2.0
    assert yaml.safe_load(changed) != yaml.safe_load(text)
