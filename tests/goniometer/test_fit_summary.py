"""What a fit says of itself in words: verdict, trade-offs, other optima, outliers, what was held."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from goniometer.fitting.intervals import Intervals
from goniometer.fitting.remarks import remarks
from goniometer.fitting.summary import fit_summary, parameter_rows, quality
from model.fit import Dataset, Estimate, FitResult
from model.fit.observable import Dolp
from model.fit.result import Alternative, Outlier, Weakness
from model.geometry import in_plane
from model.lobes import Diffuse
from model.surface import Surface

NAMES = ("sigma", "n", "k")


def correlation(n_with_k: float) -> np.ndarray:
    matrix = np.eye(3)
    matrix[1, 2] = matrix[2, 1] = n_with_k
    return matrix


FIT = FitResult(
    parameters={
        "sigma": Estimate(0.2, 0.001, False),
        "n": Estimate(2.9, 0.31, False),
        "k": Estimate(3.1, 0.42, False),
        "rho_s": Estimate(0.7, None, True),
    },
    chi_square=100.0,
    degrees_of_freedom=100,
    p_value=0.48,
    names=NAMES,
    correlation=correlation(-0.99),
    condition=20.0,
    weakness=Weakness({"sigma": 0.0001, "n": -0.309, "k": 0.419}, np.radians(45.2)),
    columns=("s0", "s1", "s2"),
    fitted=np.zeros((61, 3)),
    stokes=np.zeros((61, 3)),
    surface=Surface([Diffuse(0.1, 0.3)]),
)


def said(**changes: Any) -> str:
    return "\n".join(remarks(replace(FIT, **changes)))


def test_what_trades_off_is_said_in_words() -> None:
    assert said() == (
        "n and k trade off (condition 20): the data hardly notice when n rises by 0.31 while k falls by 0.42; add exit "
        "angles near 45°."
    )


def test_nothing_is_said_where_all_is_well() -> None:
    assert said(correlation=correlation(-0.9)) == ""


def test_a_bad_condition_is_said_whatever_the_correlations() -> None:
    text = said(correlation=correlation(0.5), condition=2345.0)
    assert text.startswith("n and k trade off (condition 2.3e+03): ")


def test_three_that_trade_off_are_all_named_and_others_are_not() -> None:
    text = said(weakness=Weakness({"sigma": 0.0009, "n": 0.3, "k": 0.4}, np.radians(-20.0)))
    assert "sigma, n and k trade off" in text
    assert "when sigma rises by 0.0009 while n rises by 0.3 and k rises by 0.4; add exit angles near -20°." in text


def test_ellipsometry_is_not_told_to_leave_the_mirror_direction() -> None:
    assert said(columns=("psi", "delta")).endswith("while k falls by 0.42; add angles of incidence.")


def test_other_optima_are_listed() -> None:
    other = Alternative({"sigma": 0.31, "n": 1.2, "k": 0.0, "rho_s": 0.5}, 1.34)
    text = said(weakness=None, alternatives=(other, replace(other, excess=3.9)))
    assert text.splitlines() == [
        "Another optimum fits almost as well (chi-square higher by 1.3): sigma 0.31, n 1.2, k 0, rho_s 0.5.",
        "Another optimum fits almost as well (chi-square higher by 3.9): sigma 0.31, n 1.2, k 0, rho_s 0.5.",
    ]


def test_what_was_held_is_said() -> None:
    assert "rho_s was held at 1, and whatever adds to light counts in it" in said(held={"rho_s": 1.0})


def test_ten_outliers_are_listed_with_their_directions_and_the_rest_counted() -> None:
    exit_rad, azimuth_rad = in_plane(np.radians(np.arange(-30.0, 31.0)))
    data = Dataset(np.full(61, np.radians(60.0)), exit_rad, azimuth_rad, np.zeros((61, 3)))
    outliers = tuple(Outlier(row, 20.0 - row) for row in (2, *range(31, 43)))
    text = remarks(replace(FIT, weakness=None, outliers=outliers), data)[0].splitlines()
    assert text[0] == "Too far from the fit for their errors, of 61 rows counted from 0: 13"
    assert text[1] == "  row 2, incidence 60°, exit -28°: 18.0 standard deviations"
    assert text[2] == "  row 31, incidence 60°, exit 1°: -11.0 standard deviations"
    assert text[11:] == ["  and 3 more"]
    turned = replace(data, azimuth_rad=np.full(61, np.radians(100.0)))
    assert "exit 28°, phi 100°" in remarks(replace(FIT, weakness=None, outliers=outliers), turned)[0]
    assert "  row 2: 18.0 standard deviations" in said(weakness=None, outliers=outliers)


@pytest.mark.parametrize(
    ("name", "value", "stderr", "is_open"),
    [
        ("n", 1.5, 0.8, True),
        ("n", 1.5, 0.7, False),
        ("k", 0.0, 2.0, False),
        ("k", 0.0, 4.0, True),
        ("sigma", 0.2, 0.11, True),
        ("rho_s", 0.001, 0.5, False),
        ("directional.n", 1.5, 0.8, True),
    ],
)
def test_parameters_that_could_be_almost_anything_are_named(
    name: str, value: float, stderr: float, is_open: bool
) -> None:
    text = said(weakness=None, parameters={name: Estimate(value, stderr, False)})
    assert text == (f"The data hardly determine {name}: almost any value would do as well." if is_open else "")


def test_what_is_not_determined_is_said_alike_in_table_and_words() -> None:
    parameters = {**FIT.parameters, "k": Estimate(7.99, None, False)}
    fit = replace(FIT, parameters=parameters, names=("sigma", "n"), correlation=np.eye(2), weakness=None)
    assert remarks(fit) == [
        "The data do not determine k: it could be anything between its bounds. The errors of the others allow for that."
    ]
    rows = {row.name: row for row in parameter_rows(fit, {"k": 3.0})}
    assert (rows["k"].value, rows["k"].error, rows["k"].off, rows["k"].note) == ("7.99", "", "", "not determined")
    assert "only if rho_s is truly at the bound" in quality(fit)


def test_without_errors_and_without_freedom_nothing_is_known_and_that_is_said() -> None:
    parameters = {name: Estimate(1.0, None, False) for name in ("n", "rho_s")}
    nothing = {"names": (), "correlation": np.empty((0, 0)), "weakness": None}
    fit = replace(FIT, parameters=parameters, p_value=None, degrees_of_freedom=0, **nothing)
    assert "nothing shows how well any parameter is known" in quality(fit)
    assert "standard errors" in quality(fit)
    assert remarks(fit) == []
    assert "nan" not in fit_summary(fit, {}).lower()


def test_biased_ratios_are_counted_with_the_remedy() -> None:
    text = said(weakness=None, biased=7)
    assert text.startswith("In 7 of 61 directions S0 or the degree of polarization is less than 5 standard errors")
    assert "fit with --objective stokes" in text
    measured = Dataset(*np.full((3, 2), 0.5), np.ones((2, 1)), None, Dolp())
    alone = remarks(replace(FIT, weakness=None, biased=7), measured)[0]
    assert "measure longer there" in alone
    assert "--objective" not in alone


def test_outliers_of_a_table_are_named_by_their_lines() -> None:
    exit_rad, azimuth_rad = in_plane(np.radians(np.arange(-30.0, 31.0)))
    data = Dataset(np.full(61, 1.0), exit_rad, azimuth_rad, np.zeros((61, 3)), lines=np.arange(61) + 9)
    text = remarks(replace(FIT, weakness=None, outliers=(Outlier(2, 9.0),)), data)[0].splitlines()
    assert text[0] == "Too far from the fit for their errors, of 61 rows: 1"
    assert text[1].startswith("  line 11, incidence")


@pytest.mark.parametrize(
    ("count", "ends"),
    [
        (50, "n: from 2.800 to 3.000, each end ± 0.038, say 50 fits"),
        (5000, "n: from 2.8000 to 3.0000, each end ± 0.0038"),
    ],
)
def test_a_bootstrap_says_no_more_digits_than_it_knows(count: int, ends: str) -> None:
    found = Intervals(scatter={"n": (2.80000123, 2.99999876)}, scatter_stderr={"n": 0.1}, count=count)
    assert found.lines()[0] == "With 95 % probability"
    assert ends in found.lines()[1]


def test_too_few_fits_make_no_interval_but_a_scatter() -> None:
    lines = Intervals(scatter_stderr={"n": 0.0512}, count=20).lines()
    assert not any("95 % probability" in line for line in lines)
    assert "each known to 16 %" in lines[0]
    assert "ask for 200" in lines[0]
    assert lines[1] == "n: 0.05"


@pytest.mark.parametrize(
    ("chi_square", "p_value", "verdict"),
    [
        (104.0, 0.37, "(1.04 per degree, p-value 0.37): the model describes the data to within their noise"),
        (180.0, 1.5e-6, "(1.8 per degree, p-value 1.5e-06): this is a bad fit. The model misses the data by more than"),
        (40.0, 1.0, "(0.4 per degree, p-value 1): the data scatter less than their error bars say"),
    ],
)
def test_chi_square_becomes_a_verdict(chi_square: float, p_value: float, verdict: str) -> None:
    assert verdict in quality(replace(FIT, chi_square=chi_square, p_value=p_value))


def test_data_without_errors_and_without_freedom_cannot_show_that_the_model_is_right() -> None:
    text = quality(replace(FIT, p_value=None, rms=0.00123))
    assert text.startswith(
        "The data came without errors: the errors here are those that their scatter about the fit makes"
    )
    assert "rms 0.00123" in text
    assert "nothing shows whether the model is right" in quality(replace(FIT, p_value=None, degrees_of_freedom=0))


def test_a_parameter_at_its_bound_is_marked() -> None:
    assert "The errors of the others hold only if rho_s is truly at the bound." in quality(FIT)
    assert [row.note for row in parameter_rows(FIT, {})] == ["", "", "", "at its bound"]


def test_angles_of_the_instrument_are_shown_in_degrees() -> None:
    turned = replace(
        FIT,
        parameters={
            "n": Estimate(2.9, 0.3, False),
            "exit_offset_rad": Estimate(np.radians(0.5), np.radians(0.1), False),
        },
        names=("n", "exit_offset_rad"),
        correlation=np.array([[1.0, 0.99], [0.99, 1.0]]),
        weakness=Weakness({"n": 0.3, "exit_offset_rad": np.radians(0.1)}, 0.0),
    )
    text = fit_summary(turned, {})
    assert "exit_offset_deg    0.50 ± 0.10" in text
    assert "n and exit_offset_deg trade off" in text
    assert "when n rises by 0.3 while exit_offset_deg rises by 0.1" in text
    assert "_rad" not in text


def test_the_truth_of_weights_counts_in_the_one_that_was_held() -> None:
    ratio = replace(FIT, parameters={"rho_d": Estimate(0.14, 0.01, False)}, held={"rho_s": 1.0})
    (row,) = parameter_rows(ratio, {"rho_s": 0.7, "rho_d": 0.1, "n": 2.9})
    assert (row.truth, row.off) == ("0.142857", "-0.3")
