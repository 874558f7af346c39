"""What a camera's optics add: each part alone, and nothing where there is none."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from pydantic import TypeAdapter, ValidationError

from sim_devices.camera.optics import AnyOptics, Blur, Vignetting, Wedge, seen_through
from sim_devices.camera.view import View

pytest.importorskip("cv2")

VIEW = View(80, 60, 100.0, (39.5, 29.5), 150.0)


def spot(column=40.0, row=30.0, sigma=2.0):
    columns, rows = np.meshgrid(np.arange(80), np.arange(60))
    return np.exp(-0.5 * ((columns - column) ** 2 + (rows - row) ** 2) / sigma**2).astype(np.float32)


def test_without_parts_the_picture_itself_comes_back():
    picture = np.stack([spot()] * 4)
    assert seen_through([], picture, VIEW) is picture
    # an open slot has no wedge
    assert seen_through([Wedge(effect="wedge", deviation_px=2.0, direction_deg=0.0)], picture, VIEW) is picture


@pytest.mark.parametrize("sigma_px", [0.4, 1.0, 3.0])
def test_blur_conserves_light_and_adds_widths_in_squares(sigma_px):
    blur = Blur(effect="blur", sigma_px=sigma_px)
    noise = np.random.default_rng(1).uniform(0, 1, (4, 60, 80)).astype(np.float32)
    blurred = blur.on(noise, VIEW)
    assert blurred.shape == noise.shape
    assert blurred.dtype == np.float32
    assert_allclose(blurred.sum(axis=(1, 2)), noise.sum(axis=(1, 2)), rtol=1e-5)
    assert blurred.std() < noise.std()
    wider = spot(sigma=np.hypot(2.0, sigma_px))
    assert_allclose(blur.on(spot(), VIEW), wider * 4 / (4 + sigma_px**2), atol=1.5e-3)
    point = blur.on(spot(sigma=0.01), VIEW)
    assert_allclose((point * (np.arange(80) - 40) ** 2).sum(), sigma_px**2, rtol=1e-3)


@pytest.mark.parametrize(
    ("polarizer_deg", "right", "up"), [(0, 1.0, 0.0), (90, 0.0, 1.0), (180, -1.0, 0.0), (45, 0.7071, 0.7071)]
)
def test_a_wedge_moves_the_picture_in_a_direction_that_turns_with_the_polarizer(polarizer_deg, right, up):
    wedge = Wedge(effect="wedge", deviation_px=1.37, direction_deg=0.0)
    moved = seen_through([wedge], spot(), VIEW, polarizer_deg)
    assert_allclose(moved, spot(40 + 1.37 * right, 30 - 1.37 * up), atol=2e-4)
    assert_allclose(wedge.shift_px(polarizer_deg), (1.37 * right, -1.37 * up), atol=1e-4)
    assert_allclose(moved.sum(), spot().sum(), rtol=1e-5)


def test_a_wedge_is_mounted_in_a_direction_and_whole_pixels_are_exact():
    noise = np.random.default_rng(2).uniform(0, 1, (60, 80)).astype(np.float32)
    moved = Wedge(effect="wedge", deviation_px=3.0, direction_deg=30.0).on(noise, VIEW, 60.0)
    # 90 deg: up
    assert_allclose(moved[:-3], noise[3:], atol=1e-6)


def test_vignetting_falls_with_cos4_or_as_the_polynomial_says():
    even = np.ones((60, 80), np.float32)
    seen = Vignetting(effect="vignetting").on(even, VIEW)
    tangent = np.hypot(39.5, 29.5) / 100
    assert_allclose([seen[0, 0], seen[-1, -1]], np.cos(np.arctan(tangent)) ** 4, rtol=1e-6)
    assert seen[30, 40] > 0.999
    bent = Vignetting(effect="vignetting", polynomial=(-0.5, 0.1)).on(even, VIEW)
    assert_allclose(bent[0, 0], 1 - 0.5 * tangent**2 + 0.1 * tangent**4, rtol=1e-6)


def test_parts_act_in_the_order_of_light_whatever_the_order_in_the_scene():
    parts = TypeAdapter(list[AnyOptics]).validate_python(
        [{"effect": "blur", "sigma_px": 1.0}, {"effect": "wedge", "deviation_px": 2.0, "direction_deg": 10.0}]
    )
    parts.append(Vignetting(effect="vignetting"))
    one, other = (seen_through(order, spot(70, 50), VIEW, 20.0) for order in (parts, parts[::-1]))
    assert_allclose(one, other, rtol=0, atol=0)
    blur, wedge, vignetting = parts
    by_hand = blur.on(vignetting.on(wedge.on(spot(70, 50), VIEW, 20.0), VIEW), VIEW)
    assert_allclose(one, by_hand, rtol=0, atol=0)


def test_unknown_parts_are_refused():
    with pytest.raises(ValidationError, match="does not match any of the expected tags"):
        TypeAdapter(AnyOptics).validate_python({"effect": "ghosts"})
