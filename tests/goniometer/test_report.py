"""The report's picture: drawn for any scan, honest about what it cannot show, nothing over anything else."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import matplotlib as mpl
import matplotlib.image
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text
from numpy.testing import assert_allclose

from acquisition.fit_points import dataset
from acquisition.readings import StokesPoint
from goniometer import report
from goniometer.errors import JournalError
from goniometer.fitted_curve import FittedCurve, fitted_curve
from goniometer.fitting.summary import quality
from goniometer.report import draw_report
from goniometer.report_panels import draw_quantity, quantities
from model.fit import Estimate, FitResult, fit, lobe_family
from model.geometry import in_plane
from model.lobes import Diffuse
from model.surface import Surface

TRUTH = {"sigma": 0.3, "n": 2.95}


def _point(exit_deg: float, s0: float, s0_stderr: float = 1e-3, aolp_deg: float = 0.5) -> StokesPoint:
    return StokesPoint(
        point=0,
        incidence_deg=60.0,
        exit_deg=exit_deg,
        azimuth_deg=0.0,
        stokes=np.array([s0, 0.3 * s0, 0.0]),
        covariance=np.diag([s0_stderr**2] * 3),
        dolp=0.3 if s0 > 0.0 else math.nan,
        dolp_debiased=0.3 if s0 > 0.0 else math.nan,
        dolp_stderr=0.02 if s0 > 0.0 else math.nan,
        aolp_deg=aolp_deg,
        aolp_stderr_deg=1.0,
    )


def _scan(count: int) -> list[StokesPoint]:
    return [_point(exit_deg, 0.1 * math.exp(exit_deg / 20.0)) for exit_deg in np.linspace(-80.0, 80.0, count)]


def _fit(points: list[StokesPoint]) -> FitResult:
    return FitResult(
        parameters={
            "sigma": Estimate(0.312, 0.011, False),
            "n": Estimate(2.95, 0.012, False),
            "rho_d": Estimate(0.0, None, True),
        },
        chi_square=8.5,
        degrees_of_freedom=8,
        p_value=0.39,
        names=("sigma", "n"),
        correlation=np.eye(2),
        stokes=np.array([np.abs(point.stokes) for point in points]),
        columns=("s0", "s1", "s2"),
        fitted=np.array([np.abs(point.stokes) for point in points]),
        surface=Surface([Diffuse(0.1, 0.3)]),
    )


def _curve(points: list[StokesPoint]) -> FittedCurve:
    ordered = sorted(points, key=lambda point: point.exit_deg)
    return FittedCurve(
        np.array([point.exit_deg for point in ordered]), np.array([np.abs(point.stokes) for point in ordered])
    )


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> list[Figure]:
    """The figures that were saved, so that a test can look at what is in them."""
    figures: list[Figure] = []
    save = Figure.savefig

    def savefig(figure: Figure, *args: object, **options: object) -> None:
        figures.append(figure)
        save(figure, *args, **options)

    monkeypatch.setattr(Figure, "savefig", savefig)
    return figures


def _draw(path: Path, points: list[StokesPoint], title: str = "iron", truth: dict[str, float] | None = None) -> None:
    draw_report(path, title=title, points=points, fit=_fit(points), curves=[_curve(points)], truth=truth or {})


@pytest.mark.parametrize(("count", "has_fit"), [(1, False), (3, True), (61, False), (2000, True)])
def test_a_picture_comes_of_any_number_of_points(tmp_path: Path, count: int, has_fit: bool) -> None:
    points = _scan(count)
    fitted = {"fit": _fit(points), "curves": [_curve(points)]} if has_fit else {"fit": None, "curves": []}
    draw_report(tmp_path / "report.png", title="iron", points=points, **fitted, truth=TRUTH)
    picture = matplotlib.image.imread(tmp_path / "report.png")
    assert picture.shape[1] == 1950
    assert picture.std() > 0.05
    assert [entry.name for entry in tmp_path.iterdir()] == ["report.png"]


@pytest.mark.parametrize("truth", [TRUTH, {}])
def test_no_text_lies_on_another_or_leaves_the_picture(
    tmp_path: Path, drawn: list[Figure], truth: dict[str, float]
) -> None:
    points = _scan(61)
    _draw(tmp_path / "report.png", points, title="iron at 60 degrees", truth=truth)
    (figure,) = drawn
    renderer = FigureCanvasAgg(figure).get_renderer()
    texts = [text for text in figure.findobj(Text) if text.get_visible() and text.get_text().strip()]
    page = figure.bbox
    boxes = [(text.get_text(), text.get_window_extent(renderer)) for text in texts]
    inside = [(text, box) for text, box in boxes if box.width and box.x1 > page.x0 and box.x0 < page.x1]
    for text, box in inside:
        assert box.x0 >= page.x0, text
        assert box.x1 <= page.x1, text
    figure_texts = [(text.get_text(), text.get_window_extent(renderer)) for text in figure.texts]
    for index, (text, box) in enumerate(figure_texts):
        for other, other_box in figure_texts[index + 1 :]:
            assert not box.overlaps(other_box), (text, other)


def test_the_table_shows_value_error_truth_difference_and_bounds(tmp_path: Path, drawn: list[Figure]) -> None:
    points = _scan(10)
    _draw(tmp_path / "report.png", points, truth=TRUTH)
    texts = {text.get_text() for text in drawn[0].texts}
    assert {"0.312", "± 0.011", "0.3", "+1.1", "at its bound", "iron"} <= texts
    assert any(
        quality(_fit(points)).startswith(text.splitlines()[0]) for text in texts if text.startswith("Chi-square")
    )


def test_the_truth_is_not_mentioned_when_nobody_knows_it(tmp_path: Path, drawn: list[Figure]) -> None:
    points = _scan(10)
    _draw(tmp_path / "report.png", points)
    assert "truth" not in {text.get_text() for text in drawn[0].texts}


def test_negative_s0_is_marked_and_counted_not_dropped(tmp_path: Path) -> None:
    points = [_point(0.0, -1e-4), _point(1.0, 1e-5), *(_point(float(deg), 0.1) for deg in range(2, 30))]
    axes = Figure().add_subplot()
    s0, *_ = quantities(points)
    draw_quantity(axes, s0)
    assert axes.get_yscale() == "log"
    assert [note.get_text() for note in axes.texts] == ["▽ 2 below the noise"]
    _draw(tmp_path / "report.png", points, title="weak")


def test_a_scan_without_any_light_is_drawn_all_the_same(tmp_path: Path) -> None:
    points = [_point(float(deg), -1e-4) for deg in range(5)]
    draw_report(tmp_path / "report.png", title="dark", points=points, fit=None, curves=[], truth={})


def test_circular_polarization_has_a_panel_where_it_was_measured(tmp_path: Path, drawn: list[Figure]) -> None:
    points = [
        replace(
            point,
            stokes=np.append(point.stokes, -0.1 * point.stokes[0]),
            covariance=np.eye(4) * 1e-6,
            docp=-0.1,
            docp_stderr=0.02,
            dop=0.4,
            dop_stderr=0.02,
        )
        for point in _scan(61)
    ]
    linear = _fit(_scan(61))
    draw_report(tmp_path / "report.png", title="iron", points=points, fit=linear, curves=[_curve(_scan(61))], truth={})
    titles = [axes.get_title("left") for axes in drawn[0].axes]
    assert titles.count("degree of circular polarization") == 1
    *_, docp = quantities(points, linear)
    assert_allclose(docp.measured, -0.1)
    assert_allclose(docp.residuals(), -5.0)
    assert len(quantities(_scan(61), linear)) == 3


def test_residuals_of_an_angle_go_the_short_way_round() -> None:
    points = [_point(0.0, 1.0, aolp_deg=89.0), _point(1.0, 1.0, aolp_deg=2.0)]
    # S2 slightly below zero and S1 < 0: an angle of -89 degrees
    stokes = np.array([[1.0, math.cos(math.radians(-178.0)), math.sin(math.radians(-178.0))], [1.0, 1.0, 0.0]])
    *_, aolp = quantities(points, replace(_fit(points), stokes=stokes))
    across = math.degrees(math.sin(math.radians(4.0)) / 2.0)
    assert_allclose(aolp.residuals(), [-across, across], atol=1e-9)


def test_points_are_drawn_in_the_order_of_the_exit_angle() -> None:
    points = [_point(10.0, 0.2), _point(-5.0, 0.1), _point(0.0, 0.3)]
    s0, *_ = quantities(points, _fit(points))
    assert_allclose(s0.exit_deg, [-5.0, 0.0, 10.0])
    assert_allclose(s0.measured, [0.1, 0.3, 0.2])
    assert s0.fitted is not None
    assert_allclose(s0.fitted, s0.measured)


def test_drawing_leaves_the_users_matplotlib_alone(tmp_path: Path) -> None:
    before = dict(mpl.rcParams)
    draw_report(tmp_path / "report.png", title="iron", points=_scan(3), fit=None, curves=[], truth={})
    assert dict(mpl.rcParams) == before


def test_a_folder_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(JournalError, match="cannot be written"):
        report.draw_report(tmp_path / "no" / "report.png", title="x", points=_scan(3), fit=None, curves=[], truth={})


def test_a_fit_is_drawn_between_the_points_as_the_instrument_would_report_it(
    tmp_path: Path, drawn: list[Figure]
) -> None:
    """Few directions, one of them twice, seen with an arm off its zero and a gain that is known."""
    family = lobe_family(
        ["specular", "diffuse"],
        free={"sigma": (0.02, 1.0), "n": (1.1, 4.0), "exit_offset_rad": (-0.1, 0.1)},
        fixed={"k": 0.0, "gain": 2.0},
    )
    truth, offset_deg = {"sigma": 0.2, "n": 1.6, "rho_s": 0.7, "rho_d": 0.1}, 1.5

    def reported(exit_deg: np.ndarray) -> np.ndarray:
        there = in_plane(np.radians(exit_deg + offset_deg))
        return 2.0 * family.surface_of({**truth}).stokes(np.full(len(exit_deg), np.radians(60.0)), *there)[:, :3]

    measured_deg = np.array([60.0, -10.0, 30.0, 60.0, 45.0, 10.0])
    points = [
        replace(_point(angle, 1.0), stokes=stokes)
        for angle, stokes in zip(measured_deg.tolist(), reported(measured_deg), strict=True)
    ]
    found = fit(dataset(points), family)
    curve = fitted_curve(points, family, found)
    assert set(measured_deg) <= set(curve.exit_deg)
    assert np.diff(curve.exit_deg).max() < 0.5
    assert_allclose(curve.stokes, reported(curve.exit_deg), rtol=1e-6, atol=1e-9)

    draw_report(tmp_path / "report.png", title="few", points=points, fit=found, curves=[curve], truth={})
    (figure,) = drawn
    panels = [axes for axes in figure.axes if axes.get_title("left").startswith(("$S_0$", "degree"))]
    for axes, expected in zip(
        panels, (curve.stokes[:, 0], np.hypot(*curve.stokes[:, 1:].T) / curve.stokes[:, 0]), strict=True
    ):
        lines = [line for line in axes.lines if len(line.get_xdata()) == len(curve.exit_deg)]
        assert_allclose([line.get_ydata() for line in lines], [expected])
    details = next(text.get_text() for text in figure.texts if "incidence" in text.get_text())
    assert "6 points" in details
    assert "direction" not in details.replace("s-direction", "")
