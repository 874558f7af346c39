"""What turns while light is collected is averaged over the exposure, exactly; what stands costs one row."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from sim_devices.analyzer import RotatingPolarizer
from sim_devices.effects.measurement import Moment
from sim_devices.motion import at_rest, move
from sim_devices.turning import TurningRow


def fine_mean(row, moment, parts=20001):
    times_s = moment.middle_s + ((np.arange(parts) + 0.5) / parts - 0.5) * moment.exposure_s
    return np.mean([row(time_s) for time_s in times_s], axis=0)


@pytest.mark.parametrize("exposure_s", [0.01, 0.3, 5.0])
@pytest.mark.parametrize("has_retarder", [False, True])
def test_the_mean_of_all_rows_on_the_way(exposure_s, has_retarder):
    way = move(0.0, -200.0, 0.0, 2000.0, velocity_deg_s=180.0, acceleration_deg_s2=900.0, deceleration_deg_s2=900.0)
    analyzer = (
        RotatingPolarizer(lambda _: 20.0, way.position, 83.0) if has_retarder else RotatingPolarizer(way.position)
    )
    moment = Moment(4.0, exposure_s)
    found = TurningRow([way.position])(analyzer.row, moment)
    assert_allclose(found, fine_mean(analyzer.row, moment), atol=2e-6)


def test_what_stands_is_looked_at_once():
    still, looked = at_rest(30.0), []
    row = RotatingPolarizer(still.position).row
    found = TurningRow([still.position])(lambda time_s: looked.append(time_s) or row(time_s), Moment(2.0, 0.5))
    assert looked == [2.0]
    assert_allclose(found, row(2.0), rtol=0)


def test_what_begins_to_turn_in_the_exposure_turns():
    way = move(2.1, 0.0, 0.0, 90.0, velocity_deg_s=900.0, acceleration_deg_s2=9000.0, deceleration_deg_s2=9000.0)
    row, moment = RotatingPolarizer(way.position).row, Moment(2.0, 0.5)
    found = TurningRow([way.position])(row, moment)
    assert_allclose(found, fine_mean(row, moment), atol=0.02)
    assert np.abs(found - row(2.0)).max() > 0.02
