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

from acquisition.readings import StokesPoint
from goniometer import report
from goniometer.errors import JournalError
from goniometer.fitting.summary import quality
from goniometer.report import draw_report
from goniometer.report_panels import draw_quantity, quantities
from model.fit import Estimate, FitResult
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


@pytest.mark.parametrize(("count", "has_fit"), [(1, False), (3, True), (61, False), (2000, True)])
def test_a_picture_comes_of_any_number_of_points(tmp_path: Path, count: int, has_fit: bool) -> None:
    points = _scan(count)
    draw_report(
        tmp_path / "report.png", title="iron", points=points, fit=_fit(points) if has_fit else None, truth=TRUTH
    )
    picture = matplotlib.image.imread(tmp_path / "report.png")
    assert picture.shape[1] == 1950
    assert picture.std() > 0.05
    assert [entry.name for entry in tmp_path.iterdir()] == ["report.png"]


@pytest.mark.parametrize("truth", [TRUTH, {}])
def test_no_text_lies_on_another_or_leaves_the_picture(
    tmp_path: Path, drawn: list[Figure], truth: dict[str, float]
) -> None:
    points = _scan(61)
    draw_report(tmp_path / "report.png", title="iron at 60 degrees", points=points, fit=_fit(points), truth=truth)
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
    draw_report(tmp_path / "report.png", title="iron", points=points, fit=_fit(points), truth=TRUTH)
    texts = {text.get_text() for text in drawn[0].texts}
    assert {"0.312", "± 0.011", "0.3", "+1.1", "at its bound", "iron"} <= texts
    assert any(
        quality(_fit(points)).startswith(text.splitlines()[0]) for text in texts if text.startswith("Chi-square")
    )


def test_the_truth_is_not_mentioned_when_nobody_knows_it(tmp_path: Path, drawn: list[Figure]) -> None:
    points = _scan(10)
    draw_report(tmp_path / "report.png", title="iron", points=points, fit=_fit(points), truth={})
    assert "truth" not in {text.get_text() for text in drawn[0].texts}


def test_negative_s0_is_marked_and_counted_not_dropped(tmp_path: Path) -> None:
    points = [_point(0.0, -1e-4), _point(1.0, 1e-5), *(_point(float(deg), 0.1) for deg in range(2, 30))]
    axes = Figure().add_subplot()
    s0, *_ = quantities(points, None)
    draw_quantity(axes, s0)
    assert axes.get_yscale() == "log"
    assert axes.get_title("right") == "▽ 2 below the noise"
    draw_report(tmp_path / "report.png", title="weak", points=points, fit=_fit(points), truth={})


def test_a_scan_without_any_light_is_drawn_all_the_same(tmp_path: Path) -> None:
    points = [_point(float(deg), -1e-4) for deg in range(5)]
    draw_report(tmp_path / "report.png", title="dark", points=points, fit=None, truth={})


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
    draw_report(tmp_path / "report.png", title="iron", points=_scan(3), fit=None, truth={})
    assert dict(mpl.rcParams) == before


def test_a_folder_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(JournalError, match="cannot be written"):
        report.draw_report(tmp_path / "no" / "report.png", title="x", points=_scan(3), fit=None, truth={})
