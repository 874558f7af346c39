"""Names beside curves: in the order of the curves' ends, none over another, none left out."""

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text
from numpy.testing import assert_allclose

from goniometer.curve_names import CurveName, apart, name_curves


@pytest.mark.parametrize("heights", [[0.5] * 6, [0.0, 0.01, 0.02, 1.0], [0.9, 0.1, 0.95, 1.0]])
def test_heights_keep_their_order_and_a_gap(heights: list[float]) -> None:
    placed = apart(np.array(heights), 0.1)
    order = np.argsort(heights, kind="stable")
    assert (np.diff(placed[order]) > 0.099).all()
    assert 0.0 <= placed.min() <= placed.max() <= 1.0


def test_heights_that_are_far_apart_stay_and_too_many_share_the_panel() -> None:
    assert_allclose(apart(np.array([0.9, 0.2, 0.5]), 0.1), [0.9, 0.2, 0.5])
    assert_allclose(np.sort(apart(np.full(21, 0.3), 0.2)), np.linspace(0.0, 1.0, 21))


def test_every_curve_is_named_and_no_name_lies_on_another() -> None:
    """One ends below the panel, one nowhere, one is no curve at all."""
    figure = Figure(figsize=(8.0, 4.0))
    canvas = FigureCanvasAgg(figure)
    axes = figure.add_axes((0.1, 0.1, 0.5, 0.8), yscale="log", ylim=(1e-3, 1.0))
    ends = {"one": (1.0, 0.5), "two": (1.0, 0.5), "low": (0.8, 1e-9), "dark": (1.0, np.nan), "open": None}
    name_curves(axes, [CurveName(name, end, "#000000") for name, end in ends.items()])
    canvas.draw()
    boxes = {text.get_text(): Text.get_window_extent(text) for text in axes.texts}
    assert set(boxes) == set(ends)
    page = figure.bbox
    for name, box in boxes.items():
        assert page.y0 <= box.y0 < box.y1 <= page.y1, name
        assert not any(box.overlaps(other) for text, other in boxes.items() if text != name), name
    assert boxes["open"].y0 > boxes["one"].y1
    assert boxes["low"].y1 < boxes["one"].y0
