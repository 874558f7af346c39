"""A flat that a rig names: made of simulated flat frames, kept with the run, and taken out of its maps."""

import h5py
import numpy as np
import pytest
from click.testing import CliRunner
from numpy.testing import assert_allclose

import goniometer
from acquisition.imaging.light.flat import Flat
from goniometer.cli import cli
from goniometer.errors import ReductionError
from goniometer.imaging.run_flat import flat_of_run
from goniometer.run_folder import measured, stored_run
from goniometer.run_results import write_results

UNEVEN = {"prnu": 0.05}
DARK_CORNERS = [{"effect": "vignetting", "polynomial": [-20.0]}]
REPEATS = 20


def light_of(run):
    with h5py.File(run / "scan.nxs") as file:
        return file["entry/maps/S0"][0], file["entry/maps/S0_errors"][0]


def test_uneven_pixels_are_taken_out_by_a_flat(camera_recipe, tmp_path):
    def run(recipe):
        return goniometer.run(recipe, speed="max", out=tmp_path / "runs", live_fit=False).folder

    even = {"patches": False, "sensor": UNEVEN, "lens": DARK_CORNERS}
    of_flat = run(camera_recipe([0], **even, readings=REPEATS))
    done = CliRunner().invoke(cli, ["export", str(of_flat), "--flat", str(tmp_path / "flat.tiff")])
    assert done.exit_code == 0, done.output
    assert "0 bad pixels, known to 0." in done.output
    plain = run(camera_recipe([0, 30], **even))
    with pytest.raises(ReductionError, match=r"has 2 directions, whose light differs\. No flat was made"):
        flat_of_run(plain)
    recipe = camera_recipe([0, 30], **even, camera={"flat": "flat.tiff", "bad_pixels": "bad.png"})
    (tmp_path / "bad.png").write_bytes(_bad_pixels())
    corrected = run(recipe)
    assert (corrected / "sensor_flat.tiff").read_bytes() == (tmp_path / "flat.tiff").read_bytes()
    shape = light_of(plain)[0].shape
    rows, columns = (index.ravel() - index.mean() for index in np.indices(shape))
    plane = np.stack([np.ones(rows.size), rows, columns, rows * rows, columns * columns, rows * columns], axis=1)

    def scatter(light):
        """Standard deviation about a smooth surface, over the mean."""
        known = np.isfinite(light.ravel())
        smooth = plane @ np.linalg.lstsq(plane[known], light.ravel()[known], rcond=None)[0]
        return float(np.nanstd(light.ravel() / smooth - 1))

    light, error = light_of(plain)
    assert_allclose(scatter(light), np.hypot(UNEVEN["prnu"], np.median(error / light)), rtol=0.05)
    light, error = light_of(corrected)
    # the flat's light is itself not quite even, which is as smooth as the plate's own shading and stays
    assert_allclose(scatter(light), np.nanmedian(error / light), rtol=0.1)
    # calibrated with the region, which is in the bright middle
    of_region = measured(corrected).points[0].stokes
    assert_allclose(light[30:42, 40:56].mean(), of_region[0], rtol=0.004)
    assert np.isnan(light[3, 5])
    assert np.isfinite(light).sum() > 0.99 * light.size


def test_a_kept_file_that_no_maps_can_use_is_named_with_what_to_do(camera_recipe, tmp_path):
    folder = goniometer.run(camera_recipe([0]), speed="max", out=tmp_path / "runs", live_fit=False).folder
    size = np.ones((10, 10), np.float32)
    for name, write, fault in (
        ("sensor_flat.tiff", Flat(size, size).save, "is of 10 x 10 pixels"),
        ("sensor_flat.tiff", lambda path: path.write_text("hello"), "is no flat"),
        ("sensor_bad_pixels.png", lambda path: path.write_text("hello"), "is no mask"),
    ):
        write(folder / name)
        (note,) = write_results(stored_run(folder)).maps.notes
        assert note.startswith(f"no maps: {folder / name} {fault}")
        assert "the run's own copy of what its rig file names: put a good one in its place" in note
        assert note.endswith(f"goniometer fit {folder}")
        (folder / name).unlink()
    made = write_results(stored_run(folder)).maps
    assert (made.made, made.notes) == (1, ())


def _bad_pixels():
    import cv2

    mask = np.zeros((72, 96), np.uint8)
    mask[3, 5] = 255
    return cv2.imencode(".png", mask)[1].tobytes()
