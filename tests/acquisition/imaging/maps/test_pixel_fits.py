"""The materials of a two-material sample come back from its maps, where they are and with the errors they have."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from acquisition.fit_choice import FitChoice
from acquisition.fit_points import directions
from acquisition.imaging.maps.binned_maps import binned
from acquisition.imaging.maps.direction_maps import DirectionMaps, PixelDirections
from acquisition.imaging.maps.pixel_fits import MaterialFits
from acquisition.imaging.place.map_grid import MapGrid
from goniometer.errors import FitError, ReductionError
from model.geometry import Rotation
from model.lobes import Diffuse, Specular
from model.many_fits.result import Status
from model.surface import Surface

INCIDENCE_DEG, EXIT_DEG = 60.0, np.arange(0.0, 61.0, 5.0)
GRID = MapGrid(left_mm=-12.0, top_mm=8.0, pixel_mm=1.0, width=24, height=16)
BOUNDARY = 11
IRON = {"sigma": 0.18, "n": 2.95, "k": 2.93, "rho_s": 0.7, "rho_d": 0.1}
GLASS = {"sigma": 0.25, "n": 1.525, "k": 0.0, "rho_s": 0.6, "rho_d": 0.15}
CHOICE = FitChoice(lobes=("specular", "diffuse"), free={"sigma": (0.02, 1.0), "n": (1.0, 6.0), "k": (0.0, 8.0)})
STATES = 0.5 * np.array([[1.0, np.cos(2 * angle), np.sin(2 * angle)] for angle in np.radians([0.0, 45.0, 90.0, 135.0])])
INVERSE = np.linalg.pinv(STATES)


def fit_maps(maps, choice, **how):
    fits = MaterialFits(choice, **how)
    for one in maps:
        fits.add(one)
    return fits.found()


def light(material, where):
    """Stokes parameters of a material, (height, width, 3), each pixel in its own exit frame."""
    index = complex(material["n"], material["k"])
    lobes = [Specular(material["rho_s"], material["sigma"], index), Diffuse(material["rho_d"], material["sigma"])]
    return Surface(lobes).stokes(*where)[..., :3]


def turned(stokes, turn_rad):
    """The same light in a frame turned clockwise by an angle."""
    s0, s1, s2 = np.moveaxis(stokes, -1, 0)
    cosine, sine = np.cos(2 * turn_rad), np.sin(2 * turn_rad)
    return np.stack([s0, cosine * s1 - sine * s2, sine * s1 + cosine * s2], axis=-1)


def exits(grid, exit_deg, distance_mm):
    """Incidence, exit and azimuth of every pixel for a camera near the sample, and where its s-direction stands."""
    x_mm, y_mm = np.meshgrid(grid.x_mm(), grid.y_mm())
    exit_rad = np.radians(exit_deg)
    camera_mm = distance_mm * np.array([0.0, -np.sin(exit_rad), np.cos(exit_rad)])
    way = camera_mm - np.stack([x_mm, y_mm, np.zeros_like(x_mm)], axis=-1)
    way /= np.linalg.norm(way, axis=-1, keepdims=True)
    # From the plate's axes to the model's: the source is at the plate's y, which is the model's x.
    where = (
        np.full(x_mm.shape, np.radians(INCIDENCE_DEG)),
        np.arccos(way[..., 2]),
        np.arctan2(-way[..., 0], way[..., 1]),
    )
    own_s = np.cross([0.0, 0.0, 1.0], way)
    up = np.array([0.0, np.cos(exit_rad), np.sin(exit_rad)])
    return where, np.arctan2(own_s @ up, own_s[..., 0])


def scan(*, grid=GRID, boundary=BOUNDARY, distance_mm=None, noise=1e-3, seed=0):
    """Maps of a sample, iron on the left and glass on the right, with noise of photons."""
    random = np.random.default_rng(seed)
    shape = grid.height, grid.width
    is_iron = (np.arange(grid.width) < boundary)[None, :, None]
    for point, exit_deg in enumerate(EXIT_DEG.tolist()):
        where, turn_rad, own = [np.full(shape, angle) for angle in directions(INCIDENCE_DEG, exit_deg)], 0.0, None
        if distance_mm is not None:
            where, turn_rad = exits(grid, exit_deg, distance_mm)
            turn = Rotation(cos2=np.cos(2 * turn_rad), sin2=np.sin(2 * turn_rad))
            own = PixelDirections.from_radians(*where[1:], turn)
        stokes = turned(np.where(is_iron, light(IRON, where), light(GLASS, where)), turn_rad)
        signals = stokes @ STATES.T
        variance = noise**2 * np.median(stokes[..., 0]) * signals
        measured = (signals + np.sqrt(variance) * random.standard_normal(signals.shape)) @ INVERSE.T
        covariance = np.einsum("aj,hwj,bj->hwab", INVERSE, variance, INVERSE)
        yield DirectionMaps(
            *(point, INCIDENCE_DEG, exit_deg, 0.0, None, grid, as_maps(measured, covariance)), pixel_directions=own
        )


def as_maps(stokes, covariance):
    maps = {f"S{i}": stokes[..., i] for i in range(3)}
    maps |= {f"S{i}_variance": covariance[..., i, i] for i in range(3)}
    maps |= {f"S{i}_S{j}_covariance": covariance[..., i, j] for i, j in ((0, 1), (0, 2), (1, 2))}
    return {name: plane.astype(np.float32) for name, plane in maps.items()}


def pulls(found, half, truth, name):
    return (found.parameters[name][half] - truth[name]) / found.stderr[name][half]


@pytest.fixture(scope="module")
def found():
    return fit_maps(scan(), CHOICE)


@pytest.mark.parametrize("name", list(IRON))
def test_parameters_of_iron_scatter_about_the_truth_as_their_errors_say(found, name):
    pull = pulls(found, np.s_[:, :BOUNDARY], IRON, name)
    assert abs(pull.mean()) < 3.0 / np.sqrt(pull.size)
    assert 0.85 < pull.std() < 1.15


@pytest.mark.parametrize("name", ["sigma", "n", "rho_s", "rho_d"])
def test_parameters_of_glass_lie_within_their_errors(found, name):
    pull = pulls(found, np.s_[:, BOUNDARY:], GLASS, name)
    # k of 0 is at its bound: it can only err upwards, and what is found together with it errs a little to one side.
    assert abs(pull.mean()) < 0.5
    assert 0.8 < pull.std() < 1.2
    at_bound = found.at_bound["k"][:, BOUNDARY:]
    assert 0.3 < at_bound.mean() < 0.7
    assert np.isnan(found.stderr["k"][:, BOUNDARY:][at_bound]).all()


def test_the_boundary_is_where_it_is_and_fits_are_good(found):
    assert_array_equal(found.parameters["n"] > 2.0, np.broadcast_to(np.arange(GRID.width) < BOUNDARY, (16, 24)))
    assert (found.status == Status.FITTED).all()
    assert_allclose((found.chi_square / found.degrees_of_freedom).mean(), 1.0, atol=0.05)
    assert found.grid == GRID
    assert found.notes == ()


def test_each_pixels_own_direction_and_frame_count():
    """At 200 mm exit angles differ by 7 degrees within the sample: far more than noise leaves unseen."""
    found = fit_maps(scan(distance_mm=200.0), CHOICE)
    assert (found.status == Status.FITTED).all()
    assert_allclose((found.chi_square / found.degrees_of_freedom).mean(), 1.0, atol=0.05)
    for half, truth in ((np.s_[:, :BOUNDARY], IRON), (np.s_[:, BOUNDARY:], GLASS)):
        for name in ("sigma", "n", "rho_s"):
            assert abs(pulls(found, half, truth, name).mean()) < 0.5


def test_flagged_pixels_stay_nan_and_those_known_in_some_directions_are_fitted():
    maps = list(scan())
    for number, one in enumerate(maps):
        for plane in one.maps.values():
            plane[3, 5] = np.nan  # always
            if number < 11:
                plane[4, 6] = np.nan  # in all but two directions
            if number % 4 == 0:
                plane[9, 20] = np.nan
    found = fit_maps(maps, CHOICE)
    for row, column in ((3, 5), (4, 6)):
        assert found.status[row, column] == Status.TOO_FEW
        for values in (*found.parameters.values(), *found.stderr.values(), found.chi_square):
            assert np.isnan(values[row, column])
    assert found.directions[3, 5] == 0
    assert found.directions[4, 6] == 2
    assert found.directions[9, 20] == 9
    assert abs(found.parameters["n"][9, 20] - GLASS["n"]) < 5.0 * found.stderr["n"][9, 20]
    assert np.count_nonzero(found.status != Status.FITTED) == 2


def test_directions_without_maps_are_left_out_and_named():
    maps = [DirectionMaps(point, INCIDENCE_DEG, 0.0, 0.0, None, GRID) for point in (7, 8)]
    found = fit_maps([*scan(), *maps], CHOICE)
    assert (found.directions == len(EXIT_DEG)).all()
    assert found.notes == ("2 of 15 directions have no maps: 7, 8.",)


def test_blocks_are_as_certain_as_their_pixels_together():
    pixels, blocks = (fit_maps(scan(boundary=12), CHOICE, bin_px=size) for size in (1, 4))
    assert blocks.grid == MapGrid(left_mm=-12.0, top_mm=8.0, pixel_mm=4.0, width=6, height=4)
    iron = np.s_[:, :12], np.s_[:, :3]
    single, whole = (np.median(one.stderr["n"][half]) for one, half in zip((pixels, blocks), iron, strict=True))
    assert_allclose(single / whole, 4.0, rtol=0.05)
    assert 0.5 < pulls(blocks, np.s_[:, :3], IRON, "n").std() < 1.6
    assert_array_equal(blocks.parameters["n"] > 2.0, np.broadcast_to(np.arange(6) < 3, (4, 6)))


def test_the_mean_of_interpolated_pixels_is_as_uncertain_as_of_the_cameras():
    """Each map pixel is the mean of two neighbours of the camera: noise of two is alike, or its half in three."""
    camera = np.random.default_rng(5).standard_normal((256, 512, 3))
    interpolated = (camera + np.roll(camera, 1, axis=1)) / 2.0
    maps = as_maps(interpolated, np.broadcast_to(0.5 * np.eye(3), (256, 512, 3, 3)))
    found = binned(DirectionMaps(0, 60.0, 30.0, 0.0, None, None, maps, noise_area_px=2.0), 16)
    stated = np.sqrt(found.covariance[..., 0, 0])
    assert_allclose(found.stokes.std(), stated[0, 0], rtol=0.1)
    single = binned(DirectionMaps(0, 60.0, 30.0, 0.0, None, None, maps, noise_area_px=2.0), 1)
    assert_allclose(single.covariance[..., 0, 0], 0.5)


def test_a_note_says_that_noise_of_neighbours_is_alike():
    maps = [replace(one, noise_area_px=2.25) for one in scan()]
    assert "alike over 2.25 pixels" in fit_maps(maps, CHOICE, bin_px=8).notes[0]


def test_blocks_that_the_model_does_not_describe_are_counted():
    assert not any("not described" in note for note in fit_maps(scan(boundary=12), CHOICE, bin_px=4).notes)
    mixed = fit_maps(scan(boundary=10), CHOICE, bin_px=4).notes  # a column of blocks holds both materials
    assert mixed[-1].startswith("4 of 24 fitted blocks are not described by the model, with a chi-square above 3 a")


def test_a_block_of_which_less_than_half_is_known_is_not():
    plane = np.ones((4, 4, 3))
    maps = as_maps(plane, np.broadcast_to(np.eye(3), (4, 4, 3, 3)).copy())
    maps["S1"][:2, :2] = [[np.nan, np.nan], [np.nan, 5.0]]
    maps["S1"][2:, 2:] = [[np.nan, np.nan], [3.0, 5.0]]
    found = binned(DirectionMaps(0, 60.0, 30.0, 0.0, None, None, maps), 2)
    assert_array_equal(found.measured, [[False, True], [True, True]])
    assert found.stokes[1, 1, 1] == 4.0
    assert_allclose(found.covariance[1, 1, 1, 1], 0.5)


def test_covariances_are_averaged_whole():
    matrix = 1e-4 * np.array([[4.0, 1.0, -0.5], [1.0, 3.0, 0.2], [-0.5, 0.2, 2.0]])
    maps = as_maps(np.ones((2, 2, 3)), np.broadcast_to(matrix, (2, 2, 3, 3)))
    found = binned(DirectionMaps(0, 60.0, 30.0, 0.0, None, None, maps), 2)
    assert_allclose(found.covariance[0, 0], matrix / 4.0, rtol=1e-6)


def test_directions_are_averaged_as_vectors_and_frames_turned_with_their_covariance():
    ones = np.ones((1, 2), np.float32)
    own = PixelDirections(10.0 * ones, np.array([[179.0, -179.0]], np.float32), np.array([[89.0, -89.0]], np.float32))
    stokes = np.broadcast_to([1.0, 0.3, 0.0], (1, 2, 3)).copy()
    covariance = np.broadcast_to(np.diag([1.0, 2.0, 3.0]) * 1e-4, (1, 2, 3, 3)).copy()
    tall = {name: np.tile(plane, (2, 1)) for name, plane in as_maps(stokes, covariance).items()}
    own = PixelDirections(*(np.tile(angle, (2, 1)) for angle in vars(own).values()))
    found = binned(DirectionMaps(0, 60.0, 10.0, 0.0, None, None, tall, pixel_directions=own), 2)
    assert_allclose(np.abs(np.degrees(found.phi_rad)), 180.0)
    assert_allclose(np.degrees(found.exit_rad), 10.0, atol=0.01)
    # An s-direction that stands upright in the picture: what was horizontal is p-polarized there.
    assert_allclose(found.stokes[0, 0], [1.0, -0.3, 0.0], atol=1e-6)
    own = PixelDirections(own.polar_deg, own.phi_deg, np.full((2, 2), 45.0, np.float32))
    found = binned(DirectionMaps(0, 60.0, 10.0, 0.0, None, None, tall, pixel_directions=own), 2)
    assert_allclose(found.stokes[0, 0], [1.0, 0.0, -0.3], atol=1e-6)
    assert_allclose(np.diag(found.covariance[0, 0]), np.array([1.0, 3.0, 2.0]) * 1e-4 / 4.0, rtol=1e-5)


def test_what_cannot_be_fitted_is_refused():
    maps = next(scan())
    with pytest.raises(FitError, match=r"maps of 0 directions.*Nothing was fitted"):
        fit_maps([], CHOICE)
    with pytest.raises(FitError, match="at least one block of 17 x 17"):
        fit_maps([maps], CHOICE, bin_px=17)
    other = next(scan(grid=MapGrid(0.0, 0.0, 1.0, 5, 4)))
    with pytest.raises(FitError, match=r"(24 x 16|5 x 4) and (24 x 16|5 x 4)"):
        fit_maps([maps, other], CHOICE)
    shifted = replace(maps, grid=MapGrid(0.0, 0.0, 1.0, 24, 16))
    with pytest.raises(FitError, match="same place"):
        fit_maps([maps, shifted], CHOICE)
    bare = {name: plane for name, plane in maps.maps.items() if name != "S1_variance"}
    with pytest.raises(ReductionError, match="hold no S1_variance"):
        fit_maps([replace(maps, maps=bare)], CHOICE)
    with pytest.raises(FitError, match="objective: dolp"):
        fit_maps([maps], CHOICE.model_copy(update={"objective": "dolp"}))
