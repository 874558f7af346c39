"""The live fit takes the newest points, mistrusts a poor last optimum, and never costs the scan anything."""

import threading

import numpy as np
from numpy.testing import assert_allclose

from acquisition import live_fit
from acquisition.events import FitRefused, FitUpdated
from acquisition.fit_points import FitArguments
from acquisition.live_fit import LiveFit
from acquisition.readings import StokesPoint
from model.fit import fit, follow, lobe_family
from model.lobes import Diffuse, Specular
from model.surface import Surface

HOW: FitArguments = {"objective": "stokes", "search": "sobol", "robust": False}
FAMILY = lobe_family(("specular", "diffuse"), {"sigma": (0.02, 1.0), "n": (1.05, 3.0)}, {"k": 0.0})


def points_of(sigma, n, count=25):
    exits_deg = np.linspace(0.0, 60.0, count)
    surface = Surface([Specular(0.7, sigma, complex(n)), Diffuse(0.1, sigma)])
    stokes = surface.stokes(np.radians(60.0), np.radians(exits_deg), np.pi)[:, :3]
    return tuple(
        StokesPoint(i, 60.0, exit_deg, 0.0, value, np.eye(3) * 1e-8, 0.0, 0.0, 0.0, 0.0, 0.0)
        for i, (exit_deg, value) in enumerate(zip(exits_deg, stokes, strict=True))
    )


def news_after(fitting, points):
    """What the thread says of these points; asked for without sleeping, for as long as a test may take."""
    fitting.submit(points)
    looking = threading.Event()
    while (news := fitting.news()) is None:
        looking.wait(0.001)
    return news


def test_points_are_fitted():
    with LiveFit(FAMILY, HOW) as fitting:
        news = news_after(fitting, points_of(0.2, 1.5))
    assert isinstance(news, FitUpdated)
    assert news.points == 25
    assert_allclose(news.result.parameters["n"].value, 1.5, rtol=1e-6)


def test_a_last_optimum_that_fits_poorly_is_not_trusted(monkeypatch):
    calls = []

    def counted(function):
        def call(*arguments, **how):
            calls.append(function.__name__)
            return function(*arguments, **how)

        return call

    for function in (fit, follow):
        monkeypatch.setattr(live_fit, function.__name__, counted(function))
    with LiveFit(FAMILY, HOW) as fitting:
        news_after(fitting, points_of(0.2, 1.5))
        news_after(fitting, points_of(0.2, 1.5))
        assert calls == ["fit", "follow"]
        mixed = points_of(0.05, 2.9)[:12] + points_of(0.9, 1.1)[12:]
        news_after(fitting, mixed)
    assert calls == ["fit", "follow", "follow", "fit"]


def test_too_few_points_are_refused_and_the_next_are_fitted():
    with LiveFit(FAMILY, HOW) as fitting:
        refused = news_after(fitting, points_of(0.2, 1.5)[:1])
        fitted = news_after(fitting, points_of(0.2, 1.5))
    assert isinstance(refused, FitRefused)
    assert "cannot determine" in refused.reason
    assert isinstance(fitted, FitUpdated)


def test_an_error_in_the_fits_own_code_is_told_and_the_thread_goes_on(monkeypatch):
    def broken(data, family, **how):
        raise ZeroDivisionError("a bug")

    monkeypatch.setattr(live_fit, "fit", broken)
    with LiveFit(FAMILY, HOW) as fitting:
        news = news_after(fitting, points_of(0.2, 1.5))
        assert isinstance(news, FitRefused)
        assert "ZeroDivisionError: a bug" in news.reason
        monkeypatch.undo()
        assert isinstance(news_after(fitting, points_of(0.2, 1.5)), FitUpdated)


def test_submitting_never_waits_and_the_newest_points_win(monkeypatch):
    begun, go_on = threading.Event(), threading.Event()
    sizes = []

    def slow(function):
        def call(data, *arguments, **how):
            sizes.append(len(data.values))
            begun.set()
            go_on.wait(10.0)
            return function(data, *arguments, **how)

        return call

    for function in (fit, follow):
        monkeypatch.setattr(live_fit, function.__name__, slow(function))
    with LiveFit(FAMILY, HOW) as fitting:
        fitting.submit(points_of(0.2, 1.5)[:20])
        begun.wait(10.0)
        for count in (21, 22, 23, 24, 25):
            fitting.submit(points_of(0.2, 1.5)[:count])
        go_on.set()
        looking = threading.Event()
        while (news := fitting.news()) is None or news.points < 25:
            looking.wait(0.001)
    assert sizes == [20, 25]
