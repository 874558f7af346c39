"""The bound on the light that needs more bounces, against fractions counted by a ray tracer."""

from __future__ import annotations

import numpy as np
import pytest

from model.bounce_bound import bounces_for, light_beyond
from model.geometry import angles
from model.groove_passage import passages
from model.groove_plane import groove_plane

# Share of 1e7 rays that left perfect mirrors after more than 1, 2, … bounces; an independent tracer. Columns: sigma,
# asymmetry, angle of incidence in degrees, shares.
TRACED = [
    (0.1, 0.5, 80.0, [0.0562767]),
    (0.3, 0.0, 60.0, [0.1026532, 2.2e-5]),
    (0.3, 0.5, 30.0, [0.0474243, 1.3e-6]),
    (0.5, 0.0, 0.0, [0.3091081, 0.0096695, 5.69e-5]),
    (0.5, 0.5, 30.0, [0.1680827, 0.001472, 1e-6]),
    (1.0, 0.0, 0.0, [0.7361178, 0.302721, 0.082346, 0.0149332, 0.0018078, 0.0001395, 7.8e-6, 1e-7]),
    (1.0, 0.0, 60.0, [0.3303883, 0.0633416, 0.0113572, 0.001574, 0.0001552, 1.02e-5]),
    (1.0, 0.5, 30.0, [0.4754553, 0.1006259, 0.009096, 0.0003854, 7.6e-6, 3e-7]),
    (1.0, 0.5, 80.0, [0.0930978, 0.0102081, 0.0007598, 3.5e-5, 8e-7]),
]


@pytest.mark.parametrize(("sigma", "asymmetry", "incidence_deg", "shares"), TRACED)
def test_no_ray_tracer_finds_more(sigma: float, asymmetry: float, incidence_deg: float, shares: list[float]) -> None:
    for bounces, share in enumerate(shares, start=1):
        assert share <= light_beyond(bounces, sigma, asymmetry)


@pytest.mark.parametrize("asymmetry", [0.0, 0.5, 0.9])
@pytest.mark.parametrize("bounces", [2, 3, 4, 7])
def test_no_groove_below_the_limit_gives_more_bounces(bounces: int, asymmetry: float) -> None:
    # The slope of the bound, read back from it, against every groove that gives one bounce more.
    limit = np.sqrt(-2.0 * np.log(light_beyond(bounces, 1.0, asymmetry)))
    rng = np.random.default_rng(0)
    plane = groove_plane(angles(*rng.uniform(0.0, 1.57, (2, 20_000)), rng.uniform(0.0, 7.0, 20_000)))
    slopes = [
        passage.grooves.slope[passage.reflectance > 0.0].min(initial=np.inf)
        for passage in passages(bounces + 1, plane, 5.0, asymmetry)
    ]
    assert limit <= min(slopes) < 1.3 * limit


def test_number_of_bounces_for_a_tolerance() -> None:
    assert bounces_for(1e-4, 0.3) == 3
    assert bounces_for(1e-4, 1.0) == 7
    assert light_beyond(7, 1.0) <= 1e-4 < light_beyond(6, 1.0)
    assert light_beyond(1, 1e-3) == 1.0


def test_says_what_is_out_of_range() -> None:
    with pytest.raises(ValueError, match="tolerance is 0"):
        bounces_for(0.0, 0.3)
    with pytest.raises(ValueError, match="bounces is 0"):
        light_beyond(0, 0.3)
    with pytest.raises(ValueError, match="asymmetry is 1"):
        light_beyond(2, 0.3, 1.0)
    with pytest.raises(ValueError, match="sigma is 0"):
        light_beyond(2, 0.0)
