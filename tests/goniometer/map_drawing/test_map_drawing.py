"""Pictures of maps: what colours mean is said, what is not known is not coloured, and pages hold what they should."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from matplotlib.image import AxesImage, imread
from numpy.testing import assert_allclose, assert_array_equal

from acquisition.imaging.maps.direction_maps import DirectionMaps
from acquisition.imaging.maps.pixel_fits import MaterialMaps
from acquisition.imaging.place.map_grid import MapGrid
from goniometer.map_drawing.blocks import arranged
from goniometer.map_drawing.files import draw_maps, draw_overview, draw_parameters
from goniometer.map_drawing.limits import Limits, limits
from goniometer.map_drawing.material_page import parameters_figure
from goniometer.map_drawing.overview import overview_figure
from goniometer.map_drawing.page import maps_figure
from goniometer.map_drawing.panels import FLAGGED, UNSURE_COLOUR, decimal_ticks
from model.many_fits.result import Status

GRID = MapGrid(left_mm=-6.0, top_mm=4.0, pixel_mm=0.5, width=24, height=16)


def direction(point=3, exit_deg=30.0, scale=1.0, **others):
    """S0 rising to the right, DoLP downwards from hardly any, AoLP from -90 to 90 degrees; one pixel is flagged."""
    column, row = np.meshgrid(np.arange(GRID.width) / 23.0, np.arange(GRID.height) / 15.0)
    maps = {
        "S0": scale * (0.1 + column),
        "DoLP": 0.02 + 0.5 * row,
        "DoLP_variance": np.full(row.shape, 0.01**2),
        "AoLP_rad": np.radians(-90.0 + 180.0 * column),
    }
    maps = {name: plane.astype(np.float32) for name, plane in maps.items()}
    for plane in maps.values():
        plane[5, 7] = np.nan
    given = {"azimuth_deg": 0.0, "exit_azimuth_deg": None, "grid": GRID, "maps": maps} | others
    return DirectionMaps(point, 60.0, exit_deg, **given)


def images(figure):
    """Axes that show maps, in the order they were drawn, with the map below and what lies on it."""
    of_axes = [(axes, [one for one in axes.get_children() if isinstance(one, AxesImage)]) for axes in figure.axes]
    return [(axes, found) for axes, found in of_axes if found]


def wide_scan(count, *, bright=False):
    """Wide maps, whose ends are round numbers."""
    grid = MapGrid(left_mm=-20.0, top_mm=11.0, pixel_mm=1.0, width=40, height=22)
    shape = (grid.height, grid.width)
    maps = {name: np.full(shape, 0.3, np.float32) for name in ("S0", "DoLP", "DoLP_variance", "AoLP_rad")}
    return [
        direction(point, 5.0 * point, grid=grid, maps=maps | {"S0": maps["S0"] * (1.5**point if bright else 1.0)})
        for point in range(count)
    ]


def titled(figure, title):
    return next((axes, found) for axes, found in images(figure) if title in axes.get_title(loc="left"))


def texts(figure):
    return [text.get_text() for text in figure.texts]


def key(figure):
    return [text.get_text() for legend in figure.legends for text in legend.get_texts()]


def ring(figure):
    return next(axes for axes in figure.axes if axes.name == "polar")


def colour_in_ring(figure, at_deg):
    """Which colour the circular legend has in a direction of the picture."""
    (mesh,) = ring(figure).collections
    cells = mesh.to_rgba(mesh.get_array()).reshape(-1, 4)
    return cells[int(at_deg % 360.0 / 360.0 * len(cells))]


def test_a_page_shows_three_maps_over_the_samples_millimetres():
    figure = maps_figure(direction(), "a plate")
    assert [axes.get_title(loc="left") for axes, _ in images(figure)] == [
        "$S_0$ (1/sr)",
        "degree of linear polarization",
        "angle of linear polarization",
    ]
    for axes, (image, *_) in images(figure):
        assert_allclose(image.get_extent(), (-6.0, 6.0, -4.0, 4.0))
        assert image.origin == "upper"
        assert axes.get_xlabel() == "x (mm)"
    assert texts(figure)[:2] == ["a plate", "point 3     incidence 60.00°     exit 30.00°     sample azimuth 0.00°"]


def test_maps_of_camera_pixels_count_rows_and_columns():
    figure = maps_figure(direction(grid=None, is_calibrated=False, exit_azimuth_deg=15.0))
    axes, (image,) = titled(figure, "$S_0$ (relative)")
    assert_allclose(image.get_extent(), (-0.5, 23.5, 15.5, -0.5))
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("column (px)", "row (px)")
    assert "exit azimuth 15.00°" in texts(figure)[1]


def test_colours_are_uniform_and_those_of_angles_end_where_they_begin():
    figure = maps_figure(direction())
    names = [found[0].get_cmap().name for _, found in images(figure)]
    assert names == ["cividis", "viridis", "twilight"]
    _, (angles, _) = titled(figure, "angle")
    assert angles.get_clim() == (-90.0, 90.0)
    assert_allclose(angles.to_rgba(-90.0), angles.to_rgba(90.0), atol=0.02)
    assert_allclose(angles.get_array()[3, [0, -1]], [-90.0, 90.0], rtol=1e-6)
    _, (dolp,) = titled(figure, "degree")
    assert_allclose(dolp.get_clim(), (0.02, 0.52), atol=1e-6)


def test_flagged_pixels_have_no_colour_but_hatching_and_are_counted():
    figure = maps_figure(direction())
    for axes, (image, *_) in images(figure):
        assert image.get_array().mask[5, 7]
        assert image.to_rgba(image.get_array())[5, 7, 3] == 0.0
        assert axes.patch.get_hatch() == FLAGGED["hatch"]
    assert "flagged: 1 of 384 pixels" in key(figure)


def test_angles_of_hardly_polarized_light_are_grey_and_counted():
    """The first row's DoLP is two of its standard errors, all others are at least five."""
    figure = maps_figure(direction())
    _, (_, grey) = titled(figure, "angle")
    shown = ~np.ma.getmaskarray(grey.get_array())
    assert_array_equal(shown, np.broadcast_to(np.arange(16)[:, None] == 0, (16, 24)))
    assert_allclose(grey.to_rgba(1.0)[:3], [int(UNSURE_COLOUR[at : at + 2], 16) / 255.0 for at in (1, 3, 5)])
    assert "angle unsure, DoLP below 3 of its standard errors: 24 pixels" in key(figure)
    known = {name: plane for name, plane in direction().maps.items() if name != "DoLP_variance"}
    assert [text for text in key(maps_figure(direction(maps=known))) if "unsure" in text] == []


@pytest.mark.parametrize(
    ("azimuth_deg", "exit_azimuth_deg", "grid", "s_at_deg"),
    [(0.0, None, GRID, 0.0), (30.0, None, GRID, -30.0), (30.0, 50.0, GRID, 20.0), (30.0, 50.0, None, 0.0)],
)
def test_the_circular_legend_shows_angles_as_directions_in_the_picture(azimuth_deg, exit_azimuth_deg, grid, s_at_deg):
    """A turned sample carries the map with it, so that s stands turned back in it; a turned arm takes s along."""
    figure = maps_figure(direction(azimuth_deg=azimuth_deg, exit_azimuth_deg=exit_azimuth_deg, grid=grid))
    _, (angles, *_) = titled(figure, "angle")
    for aolp_deg in (0.0, 45.0, -45.0, 80.0):
        for half_turn_deg in (0.0, 180.0):
            shown = colour_in_ring(figure, aolp_deg + s_at_deg + half_turn_deg)
            assert_allclose(shown, angles.to_rgba(aolp_deg), atol=0.03)
    where_deg = np.degrees(ring(figure).get_xticks())
    names = [label.get_text() for label in ring(figure).get_xticklabels()]
    for name, at_deg in (("0°", 0.0), ("45°", 45.0), ("−45°", -45.0), ("±90°", 90.0)):
        stands = [angle for angle, label in zip(where_deg, names, strict=True) if label == name]
        assert_allclose(np.sort(np.mod(stands, 180.0)), np.mod(at_deg + s_at_deg, 180.0), atol=1e-9)


def test_a_direction_without_maps_says_why():
    figure = maps_figure(direction(maps={}, notes=("No markers were found in the picture.",)))
    assert key(figure) == ["flagged: 384 of 384 pixels"]
    assert "No markers were found in the picture." in texts(figure)
    assert all(not axes.axison for axes in figure.axes if axes.get_label() == "<colorbar>")


def test_a_few_extreme_pixels_do_not_take_the_colours_and_are_counted():
    values = np.random.default_rng(0).uniform(1.0, 2.0, 10_000)
    values[:3], values[3:5], values[5] = 1000.0, -50.0, np.nan
    found = limits(values)
    assert 0.7 < found.low <= values[6:].min()
    assert values[6:].max() <= found.high < 2.3
    assert (found.below, found.above, found.extend) == (2, 3, "both")
    assert found.remark == "pixels beyond the colours: 2 below, 3 above"
    maps = direction().maps
    maps["S0"][2, 3] = 1000.0
    assert "pixels beyond the colours: 1 above" in texts(maps_figure(direction(maps=maps)))


def test_where_nothing_is_extreme_the_colours_hold_everything():
    values = np.random.default_rng(0).normal(5.0, 1e-3, 5000)
    values[0] = np.nan
    found = limits(values)
    assert found.below + found.above <= 2
    steps = limits(np.repeat([0.2, 0.7], 50))
    assert (steps.low, steps.high, steps.remark) == (0.2, 0.7, "")
    flat = limits(np.full(9, 3.0))
    assert flat.low < 3.0 < flat.high


def test_light_over_decades_is_shown_logarithmically_in_the_overview():
    wide = limits(np.geomspace(1e-3, 1.0, 500), may_be_logarithmic=True)
    assert wide.is_logarithmic
    assert_allclose((wide.low, wide.high), (1e-3, 1.0))
    assert not limits(np.linspace(0.5, 1.0, 500), may_be_logarithmic=True).is_logarithmic
    dark = limits(np.append(np.geomspace(1e-3, 1.0, 500), [0.0, -1.0]), may_be_logarithmic=True)
    assert (dark.is_logarithmic, dark.below) == (True, 2)


def test_the_overview_shows_directions_beside_each_other_with_one_scale():
    scan = [direction(point, 5.0 * point, 1.0 + point) for point in range(4)]
    scan[2] = replace(scan[2], maps={})
    figure = overview_figure(scan, "a plate")
    found = images(figure)
    assert len(found) == 12
    titles = [axes.get_title() for axes, _ in found if axes.get_title()]
    assert titles == ["exit 0°", "exit 5°", "exit 10°", "exit 15°"]
    for row in range(3):
        ends = {maps[0].get_clim() for _, maps in found[4 * row : 4 * row + 4]}
        assert len(ends) == 1
    assert [text.get_text() for axes, _ in found for text in axes.texts] == ["no map"] * 3
    assert "flagged: 387 of 1536 pixels" in key(figure)
    assert texts(figure)[1] == "directions: 4     incidence 60.00°     sample azimuth 0.00°"


def test_of_many_directions_fourteen_are_shown_from_the_first_to_the_last():
    figure = overview_figure([direction(point, 1.0 * point) for point in range(61)])
    titles = [axes.get_title() for axes, _ in images(figure) if axes.get_title()]
    assert len(titles) == 14
    assert (titles[0], titles[-1]) == ("exit 0°", "exit 60°")
    assert texts(figure)[1].startswith("14 of 61 directions")
    few = overview_figure([direction(point, 5.0 * point) for point in (0, 30, 60)], of=61)
    assert texts(few)[1].startswith("3 of 61 directions")


def test_wide_maps_of_many_directions_stand_in_two_blocks_with_legends_beside_each():
    figure = overview_figure(wide_scan(13))
    tops = {round(axes.get_position().y1, 3) for axes, _ in images(figure)}
    assert len(tops) == 6
    titles = [axes.get_title() for axes, _ in images(figure) if axes.get_title()]
    assert titles == [f"exit {5 * point}°" for point in range(13)]
    assert len([axes for axes in figure.axes if axes.name == "polar"]) == 2
    narrow = arranged((22, 40), 13, 1)
    assert (narrow.columns, narrow.count) == (7, 2)
    assert arranged((40, 10), 12, 1).count == 1
    assert arranged((22, 40), 3, 1).count == 1


@pytest.mark.parametrize(
    ("low", "high", "ticks"),
    [
        (0.025, 0.95, [0.05, 0.1, 0.2, 0.5]),
        (0.02, 1.1, [0.03, 0.1, 0.3, 1.0]),
        (1e-4, 1.0, [1e-4, 1e-3, 1e-2, 1e-1, 1.0]),
        (1e-7, 1.0, [1e-7, 1e-5, 1e-3, 1e-1]),
    ],
)
def test_a_logarithmic_legend_has_two_to_five_plain_labels(low, high, ticks):
    assert_allclose(decimal_ticks(Limits(low, high, is_logarithmic=True)), ticks)


def test_labels_of_a_logarithmic_legend_are_apart():
    scan = wide_scan(13, bright=True)
    figure = overview_figure(scan)
    renderer = figure.canvas.get_renderer()
    bar = next(axes for axes in figure.axes if axes.get_label() == "<colorbar>")
    labels = [label for label in bar.get_yticklabels(which="both") if label.get_text()]
    assert 2 <= len(labels) <= 5
    assert all(0.3 <= float(label.get_text()) < 40.0 for label in labels)
    boxes = [label.get_window_extent(renderer) for label in labels]
    assert all(upper.y0 > lower.y1 for lower, upper in pairwise(boxes))


def test_where_the_sample_turns_the_overview_says_that_the_legend_does_not():
    figure = overview_figure([direction(point, 30.0, azimuth_deg=20.0 * point) for point in range(3)])
    assert "AoLP; s turns in the maps" in texts(figure)
    titles = [axes.get_title() for axes, _ in images(figure) if axes.get_title()]
    assert titles[1] == "exit 30°\nsample azimuth 20°"


@pytest.fixture
def found():
    shape = GRID.height, GRID.width
    values = np.random.default_rng(1).uniform(1.0, 2.0, shape)
    values[4, 5:8] = np.nan
    errors = 0.01 * values
    errors[0, 0] = np.nan
    return MaterialMaps(
        grid=GRID,
        bin_px=2,
        parameters={"sigma": 0.1 * values, "n": values},
        stderr={"sigma": 0.01 * values, "n": errors},
        at_bound={"sigma": np.zeros(shape, bool), "n": np.zeros(shape, bool)},
        chi_square=33.0 * values,
        degrees_of_freedom=np.full(shape, 33),
        directions=np.full(shape, 13),
        status=np.where(np.isnan(values), Status.TOO_FEW, Status.FITTED),
        notes=("1 of 14 directions have no maps: 3.",),
    )


def test_each_parameter_stands_beside_its_error_and_fits_that_failed_are_named(found):
    figure = parameters_figure(found, "a plate")
    titles = [axes.get_title(loc="left") for axes, _ in images(figure)]
    assert titles == [
        *("sigma", "sigma: standard error", "n", "n: standard error"),
        *("reduced chi-square", "directions that count"),
    ]
    assert key(figure) == [
        "no fit (known in too few directions 3): 3 of 384 pixels",
        "no standard error: at a bound, or hardly known",
    ]
    _, (errors, grey) = titled(figure, "n: standard error")
    assert_array_equal(np.argwhere(~np.ma.getmaskarray(grey.get_array())), [[0, 0]])
    assert errors.get_array().mask[4, 6]
    _, (quality,) = titled(figure, "reduced chi-square")
    assert_allclose(quality.get_array()[1, 1], found.parameters["n"][1, 1], rtol=1e-6)
    assert "381 of 384 fits     blocks of 2 x 2 pixels" in texts(figure)
    assert found.notes[0] in texts(figure)


def test_errors_are_written_as_plain_numbers(found):
    small = replace(found, stderr={name: 1e-3 * values for name, values in found.stderr.items()})
    figure = parameters_figure(small)
    figure.canvas.draw()
    bars = [axes for axes in figure.axes if axes.get_label() == "<colorbar>"]
    assert all(not axes.yaxis.get_offset_text().get_text() for axes in bars)
    assert bars[1].get_yticklabels()[1].get_text().startswith("0.0000")


def test_blocks_on_borders_do_not_take_the_colours_of_the_material(found):
    values = found.parameters["n"].copy()
    values[:, 3] = np.where(np.arange(16) < 6, 50.0, values[:, 3])
    figure = parameters_figure(replace(found, parameters=found.parameters | {"n": values}))
    _, (image,) = next(one for one in images(figure) if one[0].get_title(loc="left") == "n")
    assert 1.9 < image.get_clim()[1] < 2.5
    assert "pixels beyond the colours: 6 above" in texts(figure)


def test_nothing_overlaps_and_nothing_leaves_the_page(found):
    scan = [direction(point, 5.0 * point, notes=("A note.",)) for point in range(12)]
    tall = replace(
        scan[0], grid=None, maps={name: np.tile(plane[:, :14], (2, 1)) for name, plane in scan[0].maps.items()}
    )
    pages = (maps_figure(scan[0]), maps_figure(tall), overview_figure(scan), overview_figure([tall]))
    pages += (overview_figure(wide_scan(13, bright=True)), overview_figure(wide_scan(5)))
    for figure in (*pages, parameters_figure(found)):
        assert figure.get_figwidth() <= 16.0
        assert figure.get_figheight() <= 11.0
        renderer = figure.canvas.get_renderer()
        page = figure.bbox
        said = [*figure.texts, *figure.legends]
        boxes = [one.get_window_extent(renderer) for one in said if not hasattr(one, "get_text") or one.get_text()]
        boxes += [axes.get_tightbbox(renderer) for axes in figure.axes if axes.axison]
        for place, box in enumerate(boxes):
            assert page.x0 <= min(box.x0, box.x1) <= max(box.x0, box.x1) <= page.x1
            assert page.y0 <= min(box.y0, box.y1) <= max(box.y0, box.y1) <= page.y1
            overlapping = [other for other in boxes[:place] if _overlap_px(box, other) > 2.0]
            assert not overlapping


def _overlap_px(one, other):
    """By how much two boxes overlap in the direction in which they do so less."""
    across = min(one.x1, other.x1) - max(one.x0, other.x0)
    return min(across, min(one.y1, other.y1) - max(one.y0, other.y0))


def test_pictures_are_files_of_a_sensible_size(tmp_path, found):
    noisy = direction()
    random = np.random.default_rng(0)
    large = {name: random.uniform(0.1, 0.9, (300, 400)).astype(np.float32) for name in noisy.maps}
    draw_maps(tmp_path / "page.png", replace(noisy, grid=None, maps=large))
    draw_overview(tmp_path / "overview.png", [noisy] * 3)
    draw_parameters(tmp_path / "parameters.png", found)
    for name in ("page", "overview", "parameters"):
        path = tmp_path / f"{name}.png"
        assert 10_000 < path.stat().st_size < 1_500_000
        assert imread(path).shape[1] >= 1000
    assert len(list(tmp_path.iterdir())) == 3
