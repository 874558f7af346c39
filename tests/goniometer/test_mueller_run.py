"""Mueller matrices from the bench to the files: whole ones, parts of them, their signs, and what is refused."""

import copy
import csv
import math
import re
from collections import Counter
from pathlib import Path

import h5py
import numpy as np
import pytest
import yaml
from numpy.testing import assert_allclose, assert_array_equal

import goniometer
from acquisition.journal import Journal
from acquisition.measured_csv import read_measured_csv
from acquisition.measured_nexus import read_measured_nexus
from acquisition.readings import MuellerPoint
from goniometer.check import describe_plan
from goniometer.errors import ConfigurationError
from goniometer.load_files import load_recipe
from goniometer.run_folder import measured
from model import materials
from model.lobes import Diffuse, Directional, Specular
from model.surface import Surface

ROOT = Path(__file__).resolve().parents[2]
IRON = 2.950 + 2.932j
LOBES = [Specular(0.7, 0.1764, IRON), Diffuse(0.1, 0.1764), Directional(0.05, 0.1764, IRON)]
QUICK = {"lobes": ["diffuse"], "free": {"sigma": [0.1, 1.0]}}
FILES = ("recipes/iron_mueller.yaml", "rigs/simulated_mueller.yaml", "scenes/iron_mueller.yaml")
WHEEL = {1: "open", 2: 0, 3: 45, 4: 90, 5: 135, 6: "blocked"}


def exact_rotator(role):
    """A rotator that rests within 2e-5 degrees of its target, so that nothing but noise is left: in rig and scene."""
    moves = {"velocity_deg_s": 50, "acceleration_deg_s2": 1000, "settle_s": 0.05, "tolerance_deg": 0.01}
    axis = {"limits_deg": [-90, 180], "home_at_start": True, "bay": 1} | moves
    in_rig = {"driver": "thorlabs_apt", "port": "simulated", "stage": "HDR50", "axes": {role: axis}}
    return in_rig, {"type": "thorlabs_apt", "stage": "HDR50", "axes": {1: role}}


class Files:
    """The shipped recipe with its rig and scene, with better rotators and short, to be changed and written."""

    def __init__(self):
        contents = [yaml.safe_load((ROOT / name).read_text(encoding="utf-8")) for name in FILES]
        self.recipe, self.rig, self.scene = contents
        self.recipe |= {"exit": {"start_deg": 0, "stop_deg": 60, "step_deg": 12}, "readings": 1, "fit": QUICK}
        for name, role in (("generator_rotator", "generator_retarder"), ("analyzer_rotator", "retarder")):
            self.rig["devices"][name], self.scene["devices"][name] = exact_rotator(role)

    def with_polarizer_as_generator(self):
        slots = dict(enumerate((0, 45, 90, 135), 1))
        self.rig["devices"]["generator"] = {"driver": "rotating_generator", "slots": slots}
        self.scene["devices"]["generator"] = {"type": "rotating_generator"}
        rotators = exact_rotator("generator_polarizer")
        self.rig["devices"]["generator_rotator"], self.scene["devices"]["generator_rotator"] = rotators
        self.recipe["generator_deg"] = [0, 45, 90, 135]
        del self.recipe["generator_retarder_deg"]
        return self

    def with_filters(self, *wavelengths_nm):
        filters = {slot: {"wavelength_nm": wavelength_nm} for slot, wavelength_nm in enumerate(wavelengths_nm, 1)}
        driven = {"driver": "thorlabs_fw102c_filters", "port": "simulated", "slot_s": 0.5, "settle_s": 0.05}
        self.rig["devices"]["filters"] = {**driven, "filters": filters}
        self.scene["devices"]["filters"] = {"type": "thorlabs_fw102c_filters", "filters": filters}
        del self.scene["lamp"]["wavelength_nm"]
        self.recipe["wavelength_nm"] = list(wavelengths_nm)
        return self

    def with_wheel_as_analyzer(self):
        driven = {"driver": "thorlabs_fw102c", "port": "simulated", "slots": WHEEL, "slot_s": 0.5, "settle_s": 0.05}
        self.rig["devices"]["analyzer"] = driven
        self.scene["devices"]["analyzer"] = {"type": "thorlabs_fw102c", "slots": WHEEL}
        for of in (self.rig, self.scene):
            del of["devices"]["analyzer_rotator"]
        self.recipe |= {"analyzer_deg": [0, 45, 90, 135], "dark": True}
        del self.recipe["retarder_deg"]
        return self

    def write(self, folder):
        for name, content in zip(FILES, (self.recipe, self.rig, self.scene), strict=True):
            (folder / name).parent.mkdir(exist_ok=True)
            (folder / name).write_text(yaml.safe_dump(content), encoding="utf-8")
        return folder / FILES[0]

    def run(self, tmp_path):
        goniometer.run(self.write(tmp_path), out=tmp_path / "runs", speed="max")
        (folder,) = (tmp_path / "runs").iterdir()
        return measured(folder)


def mueller(exit_deg, lobes=LOBES):
    azimuth = math.pi if exit_deg >= 0 else 0.0
    return Surface(lobes).mueller(math.radians(60.0), math.radians(abs(exit_deg)), azimuth)


def require_within_noise(points, lobes=LOBES):
    """Every element of all directions within its errors, by the chi-square of the scan; and each by itself."""
    chi_square = count = 0
    for point in points:
        rows, columns = point.mueller.shape
        miss = (point.mueller - mueller(point.exit_deg, lobes)[:rows, :columns]).ravel()
        pull = np.linalg.solve(np.linalg.cholesky(point.mueller_covariance), miss)
        assert np.abs(miss / np.sqrt(np.diagonal(point.mueller_covariance))).max() < 5
        chi_square, count = chi_square + pull @ pull, count + pull.size
    assert abs(chi_square - count) < 4 * math.sqrt(2 * count)


@pytest.fixture(scope="module")
def run(tmp_path_factory, drawing):
    files = Files()
    files.recipe["fit"] = yaml.safe_load((ROOT / FILES[0]).read_text(encoding="utf-8"))["fit"]
    with drawing():
        return files.run(tmp_path_factory.mktemp("mueller"))


def test_all_sixteen_elements_are_those_of_the_sample_within_their_errors(run):
    assert len(run.points) == 6
    assert all(isinstance(point, MuellerPoint) and point.mueller.shape == (4, 4) for point in run.points)
    require_within_noise(run.points)
    assert run.doubts == ()
    files_of_run = {path.name for path in run.folder.iterdir()}
    assert files_of_run >= {"mueller.csv", "stokes.csv", "scan.nxs", "fit.json", "report.png"}
    text = (run.folder / "fit.json").read_text(encoding="utf-8")
    assert abs(yaml.safe_load(text)["parameters"]["sigma"]["value"] - 0.1764) < 0.002


def test_the_same_numbers_stand_in_journal_table_nexus_and_dataset(run):
    with Journal.open(run.folder / "journal.sqlite") as journal:
        readings = journal.readings()
    made = {(one.generator_slot, one.generator_deg, one.generator_retarder_deg) for one in readings}
    assert made == {(1, 0.0, -51.7), (2, 0.0, -15.1), (3, 0.0, 15.1), (4, 0.0, 51.7)}
    assert {one.generator_retardance_deg for one in readings} == {90.0}
    table, (nexus, _) = read_measured_csv(run.folder / "mueller.csv"), read_measured_nexus(run.folder / "scan.nxs")
    for data in (table, nexus):
        assert data.observable.columns == tuple(f"m{row}{column}" for row in range(4) for column in range(4))
        assert_array_equal(data.values, [point.mueller.ravel() for point in run.points])
        assert_array_equal(data.covariance, [point.mueller_covariance for point in run.points])
    labelled = goniometer.load(run.folder)
    assert labelled["mueller_per_sr"].dims == ("exit_deg", "stokes", "incoming")
    first = labelled.isel(exit_deg=2)
    assert_array_equal(first["mueller_per_sr"], run.points[2].mueller)
    covariance = first["mueller_covariance_per_sr2"].sel(stokes="S2", incoming="S1", stokes_2="S3", incoming_2="S2")
    assert float(covariance) == run.points[2].mueller_covariance[4 * 2 + 1, 4 * 3 + 2]
    assert_array_equal(first["mueller_stderr_per_sr"].sel(stokes="S2", incoming="S3") ** 2, covariance_at(run, 2, 11))
    assert_array_equal(labelled["reading_generator_retarder_deg"], [one.generator_retarder_deg for one in readings])


def test_each_wavelength_has_its_matrices_in_the_run_the_table_and_the_nexus_file(tmp_path):
    """Those of iron at each: n and k follow the wavelength, and every file says which matrix is of which."""
    listed_nm = (525.0, 580.0)
    run = Files().with_polarizer_as_generator().with_wheel_as_analyzer().with_filters(*listed_nm).run(tmp_path)
    assert [point.wavelength_nm for point in run.points] == [525.0] * 6 + [580.0] * 6
    for wavelength_nm in listed_nm:
        index = materials.index("Fe", wavelength_nm)
        lobes = [Specular(0.7, 0.1764, index), Diffuse(0.1, 0.1764), Directional(0.05, 0.1764, index)]
        require_within_noise([point for point in run.points if point.wavelength_nm == wavelength_nm], lobes)
    with (run.folder / "mueller.csv").open(encoding="utf-8") as table:
        rows = list(csv.DictReader(line for line in table if not line.startswith("#")))
    assert [(float(row["wavelength_nm"]), float(row["m22"])) for row in rows] == [
        (point.wavelength_nm, point.mueller[2, 2]) for point in run.points
    ]
    with h5py.File(run.folder / "scan.nxs") as nexus:
        assert_array_equal(nexus["entry/mueller/wavelength"], [point.wavelength_nm for point in run.points])
    labelled = goniometer.load(run.folder)
    there = labelled.sel(wavelength_nm=580.0).isel(exit_deg=4)
    assert_array_equal(there["mueller_per_sr"], run.points[10].mueller)


def test_a_retarder_is_refused_at_several_wavelengths(tmp_path):
    with pytest.raises(
        ConfigurationError, match=r"asks for 2 wavelengths; allowed: one, because the retarder of the an"
    ):
        load_recipe(Files().with_filters(525.0, 580.0).write(tmp_path))


def covariance_at(run, point, element):
    return pytest.approx(run.points[point].mueller_covariance[element, element], rel=1e-12)


def test_polarizers_alone_tell_three_by_three_with_darks_and_references(tmp_path):
    files = Files().with_polarizer_as_generator().with_wheel_as_analyzer()
    files.recipe["reference"] = {"exit_deg": 60.0, "every_points": 2}
    dark, lamp = (
        {"effect": "dark_current", "power_w": 2e-10},
        {"effect": "lamp_drift", "relative_per_hour": 0.5},
    )
    files.scene["effects"] = [dark, lamp]
    run = files.run(tmp_path)
    kinds = [reading.kind for reading in run.readings]
    assert (kinds.count("signal"), kinds.count("dark"), kinds.count("reference")) == (6 * 16, 6, 4)
    assert len({one.generator_deg for one in run.readings if one.kind == "reference"}) == 1
    for point in run.points:
        assert point.mueller.shape == (3, 3)
        ratio = point.mueller[0, 0] / mueller(point.exit_deg)[0, 0]
        assert_allclose(point.mueller, ratio * mueller(point.exit_deg)[:3, :3], atol=2e-3)


def test_a_plate_before_the_sample_adds_a_column(tmp_path):
    run = Files().with_wheel_as_analyzer().run(tmp_path)
    assert {point.mueller.shape for point in run.points} == {(3, 4)}
    require_within_noise(run.points)
    assert min(point.mueller[2, 3] / point.mueller[0, 0] for point in run.points) < -0.4


def test_a_plate_behind_the_sample_adds_a_row(tmp_path):
    run = Files().with_polarizer_as_generator().run(tmp_path)
    assert {point.mueller.shape for point in run.points} == {(4, 3)}
    require_within_noise(run.points)
    assert max(point.mueller[3, 2] / point.mueller[0, 0] for point in run.points) > 0.4


def test_light_of_two_bounces_keeps_its_matrix(tmp_path):
    files = Files()
    files.scene["sample"] = {"material": "Fe", "sigma": 0.4, "bounces": 2, "rho_s": 0.7, "rho_d": 0, "rho_dd": 0}
    files.scene["effects"] = [{"effect": "acceptance_cone"}]
    files.recipe["exit"] = {"start_deg": 0, "stop_deg": 48, "step_deg": 12}
    lobes = [Specular(0.7, 0.4, IRON, 0.0, 2)]
    for point in files.run(tmp_path).points:
        assert_allclose(point.mueller, mueller(point.exit_deg, lobes), atol=2e-4 * mueller(0.0, lobes)[0, 0] * 10)


def fresnel(index, incidence_deg):
    """r_s and r_p of a smooth surface, in axes that are right-handed about the ray before and after."""
    cos = math.cos(math.radians(incidence_deg))
    inside = np.sqrt(index**2 - 1 + cos**2 + 0j)
    return (cos - inside) / (cos + inside), (index**2 * cos - inside) / (index**2 * cos + inside)


def textbook(index, incidence_deg):
    """The Mueller matrix of one reflection divided by M00: of Ex' = r_s Ex and Ey' = r_p Ey, and nothing else."""
    r_s, r_p = fresnel(index, incidence_deg)
    bright, dark, mixed = abs(r_s) ** 2 + abs(r_p) ** 2, abs(r_s) ** 2 - abs(r_p) ** 2, 2 * r_s * np.conj(r_p)
    matrix = np.zeros((4, 4))
    matrix[:2, :2] = [[bright, dark], [dark, bright]]
    matrix[2:, 2:] = [[mixed.real, -mixed.imag], [mixed.imag, mixed.real]]
    return matrix / bright


def mirror(tmp_path, material, incidence_deg, effects=()):
    """The matrix, divided by M00, of a surface that reflects once, seen in its mirror direction."""
    files = Files()
    files.scene["sample"] = {"index": material, "sigma": 0.1, "rho_s": 1.0, "rho_d": 0, "rho_dd": 0}
    files.scene["effects"] = list(effects)
    del files.recipe["exit"]
    files.recipe |= {"incidence_deg": incidence_deg, "exit_deg": [incidence_deg]}
    (point,) = files.run(tmp_path).points
    return point.mueller / point.mueller[0, 0]


@pytest.mark.parametrize(
    ("material", "incidence_deg", "signs"),
    [
        ({"n": 2.95, "k": 2.932}, 60.0, (-1, +1)),
        ({"n": 2.95, "k": 2.932}, 85.0, (+1, +1)),
        ({"n": 0.2, "k": 3.4}, 45.0, (-1, +1)),
        ({"n": 1.5, "k": 0.0}, 30.0, (-1, 0)),
        ({"n": 1.5, "k": 0.0}, 70.0, (+1, 0)),
    ],
    ids=["iron", "iron beyond its principal angle", "gold", "glass", "glass beyond Brewster's angle"],
)
def test_a_mirror_has_the_textbook_matrix_with_its_signs(tmp_path, material, incidence_deg, signs):
    """M22 = M33 is below 0 up to the angle where r_p turns over; M32 = -M23 is above 0 for metals with n + ik."""
    found = mirror(tmp_path, material, incidence_deg)
    assert_allclose(found, textbook(complex(material["n"], material["k"]), incidence_deg), atol=2e-5)
    for element in (found[2, 2], found[3, 3]):
        assert np.sign(element) == signs[0]
    assert (np.sign(round(found[3, 2], 4)), np.sign(round(found[2, 3], 4))) == (signs[1], -signs[1])


def test_a_mirror_at_normal_incidence_turns_plus_45_into_minus_45_and_the_handedness(tmp_path):
    assert_allclose(mirror(tmp_path, {"n": 2.95, "k": 2.932}, 0.5), np.diag([1, 1, -1, -1]), atol=2e-4)


@pytest.mark.parametrize("angle_deg", [0.0, 30.0, 120.0])
def test_a_polarizer_behind_the_mirror_stands_before_its_matrix(tmp_path, angle_deg):
    """P(a) M: light meets the mirror first, so the matrix has the polarizer's rows and the mirror's columns."""
    index = {"n": 2.95, "k": 2.932}
    found = mirror(
        tmp_path, index, 45.0, [{"effect": "reference_polarizer", "angle_deg": angle_deg, "extinction_ratio": 1e12}]
    )
    cos, sin = math.cos(math.radians(2 * angle_deg)), math.sin(math.radians(2 * angle_deg))
    passes = np.array([1.0, cos, sin, 0.0])
    expected = np.outer(passes, passes @ textbook(2.95 + 2.932j, 45.0))
    assert_allclose(found, expected / expected[0, 0], atol=1e-3)


def test_fast_and_slow_axis_mixed_up_in_one_arm_are_noticed(tmp_path):
    """Written as 270 instead of 90 degrees: what turns clockwise is taken for what turns the other way."""
    files = Files()
    files.rig["devices"]["generator"]["retardance_deg"] = 270
    (doubt,) = files.run(tmp_path).doubts
    assert doubt.startswith("The Mueller matrix is not physical in ")
    assert "retardances in the rig file" in doubt


def test_check_says_what_is_measured_and_what_turns(tmp_path):
    said = describe_plan(load_recipe(Files().write(tmp_path)))
    assert (
        "generator and analyzer: 16 settings for 16 elements of the Mueller matrix, 4 x 4, condition number 11." in said
    )
    (turns,) = re.findall(r"analyzer (\d+), generator (\d+) changes of slot", said)
    assert sorted(map(int, turns)) == [6 * 3 + 1, 6 * 12]
    assert "1/1 to 4/1, 16" in said


def test_the_plan_keeps_its_time(tmp_path):
    planned = {}

    def note(event):
        if type(event).__name__ == "ScanStarted":
            planned["s"] = event.expected_duration_s
        if type(event).__name__ == "ScanEnded":
            planned["taken"] = event.bench_duration_s

    files = Files()
    for of, shipped in ((files.rig, FILES[1]), (files.scene, FILES[2])):
        of["devices"] = yaml.safe_load((ROOT / shipped).read_text(encoding="utf-8"))["devices"]
    goniometer.run(files.write(tmp_path), out=tmp_path, speed="max", live_fit=False, subscribers=[note])
    assert abs(planned["taken"] / planned["s"] - 1.0) < 0.05


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            lambda files: [files.recipe.pop(key) for key in ("generator_deg", "generator_retarder_deg")],
            "key 'generator_deg': is missing: light always passes the generator of",
        ),
        (
            lambda files: [
                files.recipe.pop("generator_retarder_deg"),
                files.recipe.update(generator_deg=[0, 45, 90]),
            ],
            "'generator_retarder_deg': is missing: light always passes the retarder.*for each of generator_deg",
        ),
        (
            lambda files: files.recipe.update(generator_retarder_deg=[-51.7, -15.1, 15.1, 50.0]),
            r"'generator_retarder_deg.3.': got 50/0; allowed: the pairs of retarder and polarizer angle",
        ),
        (
            lambda files: files.rig["devices"].pop("generator_rotator"),
            "no device has the axis generator_retarder",
        ),
        (
            lambda files: files.rig["devices"].update(second=copy.deepcopy(files.rig["devices"]["generator"])),
            "'devices.second': is a second generator beside generator; allowed: one, or none",
        ),
        (
            lambda files: [of["devices"].pop("generator") for of in (files.rig, files.scene)],
            "axes.generator_retarder': carries nothing; allowed: with driver: rotating_generator",
        ),
        (
            lambda files: files.scene["devices"]["generator"].pop("retardance_deg"),
            "retardance_deg': is missing; allowed: a retarder, as in|turns nothing; allowed: retarder",
        ),
        (
            lambda files: files.recipe.update(adaptive=True, time_limit_s=600.0),
            "'adaptive': plans by the Stokes parameters of unpolarized light",
        ),
    ],
)
def test_what_cannot_be_is_refused_with_its_place(tmp_path, change, message):
    files = Files()
    change(files)
    with pytest.raises(ConfigurationError, match=message):
        load_recipe(files.write(tmp_path))


def test_settings_that_only_together_tell_too_little_are_refused_before_anything_moves(tmp_path):
    files = Files().with_polarizer_as_generator().with_wheel_as_analyzer()
    near = {1: 0, 2: 20, 3: 40, 4: 90}
    files.rig["devices"]["generator"]["slots"] = near
    files.rig["devices"]["analyzer"]["slots"] = {1: "open", 2: 0, 3: 20, 4: 40, 5: 135, 6: "blocked"}
    files.recipe |= {"generator_deg": [0, 20, 40], "analyzer_deg": [0, 20, 40]}
    with pytest.raises(ConfigurationError, match="'generator_deg': errors of the readings reach the Mueller matrix"):
        load_recipe(files.write(tmp_path))


def test_a_generator_that_the_rig_does_not_have_is_refused(tmp_path):
    content = yaml.safe_load((ROOT / "recipes" / "iron_60deg.yaml").read_text(encoding="utf-8"))
    content |= {"rig": str(ROOT / "rigs/simulated.yaml"), "scene": str(ROOT / "scenes/iron.yaml")}
    (tmp_path / "recipe.yaml").write_text(yaml.safe_dump(content | {"generator_deg": [0, 60, 120]}), encoding="utf-8")
    with pytest.raises(ConfigurationError, match="'generator_deg': is given, but there is no generator in"):
        load_recipe(tmp_path / "recipe.yaml")


def test_several_incidences_and_repeats_give_a_matrix_each(tmp_path):
    files = Files()
    files.recipe |= {"exit": {"start_deg": 20, "stop_deg": 60, "step_deg": 40}, "incidence_deg": [30, 60], "repeats": 2}
    run = files.run(tmp_path)
    assert len(run.readings) == 2 * 2 * 2 * 16
    assert [round(point.incidence_deg) for point in run.points] == [30, 30, 60, 60]
    require_within_noise(run.points[2:])
    other = Surface(LOBES).mueller(math.radians(30.0), math.radians(60.0), math.pi)
    assert_allclose(run.points[1].mueller, other, atol=5 * math.sqrt(run.points[1].mueller_covariance.max()))


def test_every_pair_is_read_until_its_ratio_is_reached(tmp_path):
    files = Files()
    files.recipe |= {"exit": {"start_deg": 30, "stop_deg": 60, "step_deg": 30}}
    files.recipe["readings"] = {"at_least": 2, "at_most": 300, "signal_to_noise": 400}
    run = files.run(tmp_path)
    pairs = Counter((one.point, one.generator_slot, one.slot) for one in run.readings)
    assert len(pairs) == 2 * 16
    assert min(pairs.values()) == 2
    assert max(pairs.values()) > 10
    assert run.doubts == ()
    require_within_noise(run.points)


def test_rounds_until_the_dolp_is_known_take_all_pairs(tmp_path):
    files = Files()
    files.recipe |= {"exit": {"start_deg": 12, "stop_deg": 48, "step_deg": 36}}
    files.recipe["readings"] = {"at_least": 1, "at_most": 60, "dolp_error": 0.004}
    run = files.run(tmp_path)
    assert all(point.dolp_stderr <= 0.004 for point in run.points)
    for point in (0, 1):
        pairs = Counter((one.generator_slot, one.slot) for one in run.readings if one.point == point)
        assert len(pairs) == 16
        assert len(set(pairs.values())) == 1
    assert len(run.readings) > 3 * 16
    require_within_noise(run.points)
