"""Tables of measured values: every kind of column gives the truth back, and nothing ambiguous is read."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from acquisition.fit_points import dataset
from acquisition.measured_csv import read_measured_csv
from acquisition.readings import StokesPoint
from acquisition.stokes_csv import write_stokes_csv
from goniometer.errors import FitError, JournalError
from model.fit import Dataset, fit, lobe_family
from model.fit.observable import MUELLER, STOKES, Dolp, Elements, Ratios
from model.geometry import in_plane

FAMILY = lobe_family(("specular", "diffuse", "directional"), {"sigma": (0.02, 1.0), "n": (1.0, 6.0), "k": (0.0, 8.0)})
TRUTH = {"sigma": 0.2, "n": 2.95, "k": 2.93, "rho_s": 0.7, "rho_d": 0.1, "rho_dd": 0.05}
EXIT_DEG = np.arange(-30.0, 66.0, 5.0)
ANGLES = "incidence_deg,exit_deg"


def write(path: Path, header: str, rows: np.ndarray | list[list[float]]) -> Path:
    lines = [",".join(repr(float(value)) for value in row) for row in rows]
    path.write_text("\n".join([header, *lines, ""]), encoding="utf-8")
    return path


def truly(elements: str = "stokes") -> np.ndarray:
    """The light of the true surface at 60° incidence, (N, 4) or (N, 16)."""
    exit_rad, azimuth_rad = in_plane(np.radians(EXIT_DEG))
    seen = FAMILY.seen(TRUTH)
    light = getattr(seen, elements)(np.full(len(EXIT_DEG), np.radians(60.0)), exit_rad, azimuth_rad)
    return np.asarray(light).reshape(len(EXIT_DEG), -1)


def with_angles(values: np.ndarray) -> np.ndarray:
    return np.column_stack([np.full(len(EXIT_DEG), 60.0), EXIT_DEG, values])


def assert_recovered(data: Dataset, truth: dict[str, float]) -> None:
    found = fit(data, FAMILY).values
    assert_allclose([found[name] for name in truth], list(truth.values()), rtol=1e-6)


RATIOS = {name: TRUTH[name] / (0.7 if name.startswith("rho") else 1.0) for name in TRUTH if name != "rho_s"}


def test_stokes_columns_give_the_truth_back(tmp_path: Path) -> None:
    rows = with_angles(np.column_stack([truly()[:, :3], np.full((len(EXIT_DEG), 3), 1e-4)]))
    header = f"{ANGLES},s0_per_sr,s1_per_sr,s2_per_sr,s0_stderr_per_sr,s1_stderr_per_sr,s2_stderr_per_sr"
    data = read_measured_csv(write(tmp_path / "scan.csv", header, rows))
    assert data.observable == Elements((0, 1, 2), STOKES)
    assert_array_equal(data.covariance, np.broadcast_to(1e-8 * np.eye(3), (len(EXIT_DEG), 3, 3)))
    assert data.name == "scan.csv"
    assert_recovered(data, TRUTH)


def test_mueller_elements_give_the_truth_back(tmp_path: Path) -> None:
    rows = with_angles(truly("mueller")[:, [10, 0, 1, 5]])
    data = read_measured_csv(write(tmp_path / "scan.csv", f"{ANGLES},m22,m00,m01,m11", rows))
    assert data.observable == Elements((0, 1, 5, 10), MUELLER)
    assert data.covariance is None
    assert_recovered(data, TRUTH)


def test_mueller_elements_without_the_first_are_ratios(tmp_path: Path) -> None:
    matrices = truly("mueller")
    ratios = matrices[:, [1, 5, 10, 11]] / matrices[:, :1]
    rows = with_angles(np.column_stack([ratios, np.full(ratios.shape, 1e-3)]))
    header = f"{ANGLES},m01,m11,m22,m23,m01_stderr,m11_stderr,m22_stderr,m23_stderr"
    data = read_measured_csv(write(tmp_path / "scan.csv", header, rows))
    assert data.observable == Ratios((1, 5, 10, 11), MUELLER)
    assert_recovered(data, RATIOS)


def test_dolp_gives_the_truth_back(tmp_path: Path) -> None:
    stokes = truly()
    dolp = np.hypot(stokes[:, 1], stokes[:, 2]) / stokes[:, 0]
    rows = with_angles(np.column_stack([dolp, np.full(len(dolp), 1e-3)]))
    data = read_measured_csv(write(tmp_path / "scan.csv", f"{ANGLES},dolp,dolp_stderr", rows))
    assert data.observable == Dolp()
    assert_recovered(data, RATIOS)


def test_a_scan_out_of_the_plane_has_an_azimuth_and_no_sign(tmp_path: Path) -> None:
    rows = [[60.0, 30.0, 180.0, 0.5], [60.0, 30.0, 0.0, 0.4], [50.0, 20.0, -90.0, 0.3]]
    data = read_measured_csv(write(tmp_path / "scan.csv", f"{ANGLES},phi_deg,dolp", rows))
    assert_array_equal(data.azimuth_rad, [np.pi, 0.0, -np.pi / 2.0])
    in_the_plane = read_measured_csv(write(tmp_path / "plane.csv", f"{ANGLES},dolp", [[60, 30, 0.5], [60, -30, 0.4]]))
    for angle in ("incidence_rad", "exit_rad", "azimuth_rad"):
        assert_array_equal(getattr(data, angle)[:2], getattr(in_the_plane, angle))


SMOOTH = lobe_family(("specular",), {"n": (0.02, 6.0), "k": (0.0, 8.0)}, {"sigma": 0.01})


@pytest.mark.parametrize(
    ("index", "delta_at_75"),
    [(complex(1.52, 0.0), 0.0), (complex(2.95, 2.932), 101.2), (complex(0.06, 3.6), 91.9)],
)
def test_psi_and_delta_give_the_index_back(tmp_path: Path, index: complex, delta_at_75: float) -> None:
    incidence_deg = np.array([55.0, 65.0, 75.0])
    psi_deg, delta_deg = ellipsometry(index, incidence_deg)
    # Of bare glass, iron and silver an ellipsometer shows a delta from 0 to 180.
    assert_allclose(delta_deg[2], delta_at_75, atol=0.3)
    rows = np.column_stack([incidence_deg, psi_deg, delta_deg])
    data = read_measured_csv(write(tmp_path / "psi.csv", "incidence_deg,psi_deg,delta_deg", rows))
    found = fit(data, SMOOTH).values
    assert_allclose([found["n"], found["k"]], [index.real, index.imag], rtol=1e-6, atol=1e-6)
    counted_otherwise = np.column_stack([incidence_deg, psi_deg, 360.0 + delta_deg - 360.0 * (delta_deg > 0.0)])
    data = read_measured_csv(write(tmp_path / "turn.csv", "incidence_deg,psi_deg,delta_deg", counted_otherwise))
    found = fit(data, SMOOTH).values
    assert_allclose([found["n"], found["k"]], [index.real, index.imag], rtol=1e-6, atol=1e-6)


def ellipsometry(index: complex, incidence_deg: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Psi and delta of a flat surface from Fresnel's equations as ellipsometry writes them, with N = n - ik."""
    outside = np.cos(np.radians(incidence_deg))
    inside = np.sqrt(1.0 - (np.sin(np.radians(incidence_deg)) / np.conj(index)) ** 2)
    r_p = (np.conj(index) * outside - inside) / (np.conj(index) * outside + inside)
    r_s = (outside - np.conj(index) * inside) / (outside + np.conj(index) * inside)
    rho = r_p / r_s
    return np.degrees(np.arctan(np.abs(rho))), np.degrees(np.angle(rho)) % 360.0


def test_psi_alone_is_the_dolp_of_a_smooth_surface(tmp_path: Path) -> None:
    incidence_deg = np.array([30.0, 45.0, 70.0])
    psi_deg, _ = ellipsometry(complex(1.52, 0.0), incidence_deg)
    rows = np.column_stack([incidence_deg, psi_deg])
    psi = read_measured_csv(write(tmp_path / "psi.csv", "incidence_deg,psi_deg", rows))
    dolp = np.abs(np.cos(2.0 * np.radians(psi_deg)))
    rows = np.column_stack([incidence_deg, incidence_deg, dolp])
    same = read_measured_csv(write(tmp_path / "dolp.csv", f"{ANGLES},dolp", rows))
    glass = lobe_family(("specular",), {"n": (1.2, 2.0)}, {"sigma": 0.01, "k": 0.0})
    assert_allclose(fit(psi, glass).values["n"], 1.52, rtol=1e-8)
    assert_allclose(fit(same, glass).values["n"], 1.52, rtol=1e-8)


def test_errors_of_psi_and_delta_become_those_of_the_index(tmp_path: Path) -> None:
    incidence_deg, index = np.array([60.0, 70.0]), complex(2.95, 2.932)
    psi_deg, delta_deg = ellipsometry(index, incidence_deg)
    rows = np.column_stack([incidence_deg, psi_deg, delta_deg, [0.02, 0.03], [0.05, 0.06]])
    header = "incidence_deg,psi_deg,delta_deg,psi_stderr_deg,delta_stderr_deg"
    result = fit(read_measured_csv(write(tmp_path / "psi.csv", header, rows)), SMOOTH)
    # The same from numerical differences of Fresnel's equations.
    step = 1e-6
    slopes = [
        (np.array(ellipsometry(index + h, incidence_deg)) - np.array(ellipsometry(index - h, incidence_deg)))
        / (2 * step)
        for h in (step, step * 1j)
    ]
    jacobian = np.array(slopes).reshape(2, -1) / np.array([0.02, 0.03, 0.05, 0.06])
    covariance = np.linalg.inv(jacobian @ jacobian.T)
    assert_allclose([result.parameters[name].stderr for name in "nk"], np.sqrt(np.diag(covariance)), rtol=1e-5)


def test_a_runs_own_table_reads_back_to_the_same_data(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    points = []
    for number, (incidence_deg, exit_deg) in enumerate([(60.0, -20.0), (60.0, 1.0 / 3.0), (0.0, 45.0), (-0.004, 30.0)]):
        root = rng.normal(size=(3, 4)) * 1e-3
        points.append(
            StokesPoint(
                *(number, incidence_deg, exit_deg, 12.5, np.abs(rng.normal(size=3)), root @ root.T),
                *(0.5, 0.49, 0.01, -30.0, 0.7),
            )
        )
    write_stokes_csv(tmp_path / "stokes.csv", points)
    read, measured = read_measured_csv(tmp_path / "stokes.csv"), dataset(points)
    for name in ("incidence_rad", "exit_rad", "azimuth_rad", "values", "covariance"):
        assert_array_equal(getattr(read, name), getattr(measured, name), err_msg=name)


PLAIN = f"{ANGLES},dolp\n60,10,0.25\n60,20,0.5\n"


@pytest.mark.parametrize(
    "text",
    [
        "\ufeff" + PLAIN,
        PLAIN.replace("\n", "\r\n"),
        PLAIN.replace("\n", "\r"),
        "# a comment, with commas; and 1,5\n\n" + PLAIN.replace("\n60,20", "\n  # another\n\n60,20"),
        PLAIN.replace(",", ";"),
        PLAIN.replace(",", "\t"),
        PLAIN.replace(",", " , "),
        PLAIN.replace(",", ";").replace(".", ","),
        PLAIN.replace(",", "\t").replace(".", ","),
        PLAIN.replace(",", ";").replace("60", "60,000").replace(".", ","),
        PLAIN.replace("0.25", '"0,25"').replace("0.5", '"0,5"'),
        PLAIN.replace("0.25", "+2.5e-1").replace("0.5", ".5").replace("60", "6.E1"),
        "dolp,exit_deg,incidence_deg\n0.25,10,60\n0.5,20,60",
    ],
    ids=range(13),
)
def test_what_is_unambiguous_is_read(tmp_path: Path, text: str) -> None:
    path = tmp_path / "table.csv"
    path.write_bytes(text.encode())
    data = read_measured_csv(path)
    assert_array_equal(data.values, [[0.25], [0.5]])
    assert_allclose(np.degrees(data.exit_rad), [10.0, 20.0])


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("", ":1: there is no table here"),
        ("# only a comment\n", ":1: there is no table here"),
        (PLAIN.partition("\n")[0], ":1: there is no row of numbers below"),
        ("60,10,0.25\n", ":1: found '60, 10, 0.25' where the names of columns should be"),
        ("incidence_deg exit_deg dolp\n60 10 0.25\n", ":1: found 'incidence_deg exit_deg dolp'"),
        (PLAIN.replace("dolp", "dop"), "did you mean dolp?"),
        (PLAIN.replace("dolp", "S0"), ":1: column S0 is not known; did you mean s0_per_sr?"),
        (PLAIN.replace("dolp", "S0_stderr"), ":1: column S0_stderr is not known; did you mean s0_stderr_per_sr?"),
        (PLAIN.replace("exit_deg", "exit"), ":1: column exit is not known; did you mean exit_deg?"),
        (PLAIN.replace("exit_deg", "Exit_Deg"), ":1: column Exit_Deg is not known; did you mean exit_deg?"),
        (PLAIN.replace("dolp", "dolp,temperature_k").replace("0.", "0.1,0."), ":1: column temperature_k is not known"),
        (PLAIN.replace("dolp", "dolp,dolp").replace("0.", "0.1,0."), ":1: column dolp stands 2 times"),
        (PLAIN.replace("dolp\n", "dolp,\n"), ":1: a column has no name"),
        (PLAIN.replace("exit_deg", "phi_deg"), ":1: there is no column exit_deg"),
        (PLAIN.replace("incidence_deg", "azimuth_deg"), ":1: there is no column incidence_deg"),
        (PLAIN.replace("dolp", "dolp_stderr"), ":1: there is no column of values"),
        (
            PLAIN.replace("dolp", "dolp,m00").replace("0.", "0.1,0."),
            ":1: there are columns of Mueller and of DoLP values",
        ),
        (PLAIN.replace("dolp", "s1_per_sr"), ":1: there is no column s0_per_sr"),
        (PLAIN.replace("dolp", "delta_deg"), ":1: there is no column psi_deg"),
        (
            PLAIN.replace("dolp", "dolp,s0_stderr_per_sr").replace("0.", "0.1,0."),
            "s0_stderr_per_sr has no place beside dolp",
        ),
        (
            PLAIN.replace("dolp", "dolp,aolp_deg").replace("0.", "0.1,0."),
            ":1: column aolp_deg has no place beside dolp",
        ),
        (
            PLAIN.replace("dolp", "m01,m11,m01_stderr").replace("0.", "0.1,0.1,0."),
            ":1: there is no column m11_stderr, which the others need",
        ),
        (
            PLAIN.replace("dolp", "s0_per_sr,s1_per_sr,cov_s0_s0_per_sr2").replace("0.", "0.1,0.1,0."),
            ":1: there is no column cov_s0_s1_per_sr2, which the others need",
        ),
        (PLAIN.replace("exit_deg,", "exit_deg;"), ":1: the column names are separated by comma and semicolon"),
        (PLAIN.replace("0.5", ""), ":3: column dolp: found nothing; write a finite number"),
        (PLAIN.replace("0.5", "nan"), ":3: column dolp: found 'nan'; write a finite number"),
        (PLAIN.replace("0.5", "-inf"), ":3: column dolp: found '-inf'; write a finite number"),
        (PLAIN.replace("0.5", "1e999"), ":3: column dolp: found '1e999'; write a finite number"),
        (PLAIN.replace("0.5", "n/a"), ":3: column dolp: found 'n/a'; write a finite number"),
        (PLAIN.replace("0.5", "0x1"), ":3: column dolp: found '0x1'"),
        (PLAIN.replace("0.5", "1_0"), ":3: column dolp: found '1_0'"),
        (PLAIN.replace("0.5", "٠.٥"), ":3: column dolp: found '٠.٥'"),
        (PLAIN.replace("0.5", "0.5 deg"), ":3: column dolp: found '0.5 deg'"),
        (PLAIN.replace("0.5", "0.5,"), ":3: found 4 values; the 3 columns need as many"),
        (PLAIN.replace(".", ","), ":2: found 4 values; the 3 columns need as many; are these decimal commas?"),
        (PLAIN.replace("60,20,0.5", "60,20"), ":3: found 2 values; the 3 columns need as many; is one missing?"),
        (PLAIN.upper(), ":1: column INCIDENCE_DEG is not known; did you mean incidence_deg?"),
        (PLAIN.replace("dolp", "s0_per_sr").replace("0.", "-0."), ":1: column s0_per_sr is nowhere above 0"),
        (
            PLAIN.replace("dolp", "s0_per_sr,s0_stderr_per_sr").replace("0.25", "1,0.1").replace("0.5", "-0.6,0.1"),
            ":3: column s0_per_sr: found -0.6; light is never below 0 by more than its noise",
        ),
        (
            PLAIN.replace("dolp", "m00,m00_stderr").replace("0.25", "1,0.1").replace("0.5", "-0.6,0.1"),
            ":3: column m00: found -0.6; light is never below 0",
        ),
        (PLAIN.replace("0.5", '"0.5'), ":3: the quotes of this line are broken"),
        (PLAIN.replace(",", ";").replace("0.25", "0,25"), ":2: column dolp: found '0,25', and in line 3 '0.5'"),
        (
            PLAIN.replace(",", ";").replace("60;", "1,234;").replace("0.25", "1").replace("0.5", "1"),
            ":2: column incidence_deg: found '1,234', which may be 1.234 or 1234",
        ),
        (PLAIN.replace(",", ";").replace("0.25", "1.234,5"), ":2: column dolp: found '1.234,5'"),
        (PLAIN.replace("60,20", "90,20"), ":3: column incidence_deg: found 90; allowed: from 0 to below 90"),
        (PLAIN.replace("60,20", "-60,20"), ":3: column incidence_deg: found -60; allowed: from 0"),
        (PLAIN.replace("60,20", "60,-95"), ":3: column exit_deg: found -95; allowed: above -90 to below 90"),
        (
            PLAIN.replace("dolp", "phi_deg,dolp").replace("20,", "-20,180,").replace("10,", "10,0,"),
            ":3: column exit_deg: found -20; allowed: from 0 to below 90, for phi_deg says on which side",
        ),
        (
            PLAIN.replace("dolp", "phi_deg,dolp").replace("20,", "20,400,").replace("10,", "10,0,"),
            ":3: column phi_deg: found 400",
        ),
        (PLAIN.replace("0.5", "-0.5"), ":3: column dolp: found -0.5; allowed: from 0 to 1, not in percent"),
        (PLAIN.replace("0.5", "50"), ":3: column dolp: found 50; allowed: from 0 to 1, not in percent"),
        (
            PLAIN.replace("dolp", "dolp,dolp_stderr").replace("0.25", "0.25,0.1").replace("0.5", "0.5,-0.1"),
            ":3: column dolp_stderr: found -0.1; allowed: above 0",
        ),
        (
            PLAIN.replace("dolp", "dolp,dolp_stderr").replace("0.25", "0.25,0").replace("0.5", "0.5,0.1"),
            ":2: column dolp_stderr: found 0; allowed: above 0; take all columns of errors out if nobody knows them",
        ),
        (
            PLAIN.replace("dolp", "m01").replace("0.5", "3"),
            ":3: column m01: found 3; allowed: -1 to 1, for without m00",
        ),
        (
            PLAIN.replace("dolp", "m00,m01").replace("0.", "1,0."),
            ":1: column m00 is 1 throughout, as if the others had been divided by it",
        ),
        (PLAIN.replace("dolp", "psi_deg").replace("0.5", "91"), ":3: column psi_deg: found 91; allowed: from 0 to 90"),
        (
            PLAIN.replace("dolp", "psi_deg,delta_deg").replace("0.25", "30,-100").replace("0.5", "30,250"),
            ":1: column delta_deg is that of no bare surface",
        ),
    ],
)
def test_what_is_not_is_refused_with_its_line(tmp_path: Path, text: str, complaint: str) -> None:
    path = tmp_path / "table.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(FitError) as caught:
        read_measured_csv(path)
    assert complaint in str(caught.value).replace(str(path), "")
    assert "Nothing was fitted" in str(caught.value)


def test_every_fault_is_named_up_to_ten_and_the_rest_counted(tmp_path: Path) -> None:
    path = tmp_path / "table.csv"
    path.write_text(f"{ANGLES},dolp\n" + "60,10,nan\n" * 13, encoding="utf-8")
    with pytest.raises(FitError) as caught:
        read_measured_csv(path)
    lines = str(caught.value).splitlines()
    assert [line.partition(": ")[0] for line in lines[:10]] == [f"{path}:{number}" for number in range(2, 12)]
    assert lines[10] == "and 3 more like these"


@pytest.mark.parametrize(
    ("covariance", "complaint"),
    [
        ([1e-4, 2e-5, 3e-5, 1e-4], "the covariance of a pair is not that of the same pair the other way"),
        ([1e-4, 2e-4, 2e-4, 1e-4], "a sum of the values would have no error"),
        ([4e-4, 2e-5, 2e-5, 1e-4], "the columns stderr are not the roots of the columns cov"),
    ],
)
def test_impossible_covariances_are_refused(tmp_path: Path, covariance: list[float], complaint: str) -> None:
    pairs = ",".join(f"cov_s{i}_s{j}_per_sr2" for i in (0, 1) for j in (0, 1))
    header = f"{ANGLES},s0_per_sr,s1_per_sr,s0_stderr_per_sr,s1_stderr_per_sr,{pairs}"
    good = [60.0, 20.0, 0.5, 0.1, 0.01, 0.01, 1e-4, 2e-5, 2e-5, 1e-4]
    path = write(tmp_path / "table.csv", header, [good, [*good[:6], *covariance]])
    with pytest.raises(FitError, match=f"table.csv:3: .*{complaint}"):
        read_measured_csv(path)


def test_files_that_are_no_text_are_named(tmp_path: Path) -> None:
    with pytest.raises(JournalError, match=r"none\.csv cannot be read"):
        read_measured_csv(tmp_path / "none.csv")
    path = tmp_path / "excel.csv"
    path.write_bytes(PLAIN.encode("utf-16"))
    with pytest.raises(FitError, match=r"excel\.csv:1: this is not UTF-8 text"):
        read_measured_csv(path)


def test_rows_remember_the_lines_that_they_stand_in(tmp_path: Path) -> None:
    path = tmp_path / "table.csv"
    path.write_text("# a comment\nincidence_deg,exit_deg,s0_per_sr,s1_per_sr\n60,10,1,0\n\n# another\n60,20,-0.1,0\n")
    data = read_measured_csv(path)
    assert data.lines.tolist() == [3, 6]
    assert data.some(np.array([1])).place(0) == "line 6"
    with pytest.raises(FitError, match=r"Line 6 of table.csv \(incidence 60°.*s0 is not above 0.*objective stokes"):
        fit(data, lobe_family(("diffuse",), {}, {"sigma": 0.1}), objective="normalised")
    assert data.joined(data).lines is None
