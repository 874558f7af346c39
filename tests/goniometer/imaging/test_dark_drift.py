"""A camera whose black level creeps from picture to picture, while the noise is the same: so are the maps."""

import numpy as np
import pytest

from goniometer.imaging.run_maps import run_maps
from goniometer.run_folder import measured
from sim_devices.camera.sensor import Sensor

COUNTS_A_PICTURE = 3
BLURRED = [{"effect": "blur", "sigma_px": 0.7}]
DIRECTIONS = [0, 10, 20, 30, 40, 50, 60]


@pytest.fixture
def maps(tmp_path, run_in, monkeypatch):
    """Makes a scan with a level that rises by so many counts from one picture to the next."""
    as_designed = Sensor.counts

    def made(name, step):
        def creeping(sensor, power_w, exposure_s, gain_db, bits, number):
            return as_designed(sensor, power_w, exposure_s, gain_db, bits, number) + np.uint16(step * number)

        monkeypatch.setattr(Sensor, "counts", creeping)
        scan = run_in(tmp_path / name, exit_deg=DIRECTIONS, imaging={"area": None, "registration": None}, lens=BLURRED)
        return list(run_maps(measured(scan.folder)))

    return made


def test_a_black_level_that_creeps_by_many_read_noises_leaves_the_maps_as_they_are(maps):
    for still, creeping in zip(maps("still", 0), maps("creeping", COUNTS_A_PICTURE), strict=True):
        assert creeping.notes == still.notes == ()
        for name in ("S0", "S1", "S2"):  # the mean of all pixels, beside the standard error of one
            apart = creeping.maps[name].mean(dtype=float) - still.maps[name].mean(dtype=float)
            stderr = np.sqrt(still.maps[f"{name}_variance"].mean(dtype=float))
            assert abs(apart) < 0.1 * stderr, (name, still.exit_deg)
