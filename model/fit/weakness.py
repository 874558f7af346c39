"""What data can hardly tell apart, and where one more reading would help most."""

from __future__ import annotations

import numpy as np

from model.fit.dataset import Dataset
from model.fit.family import SurfaceFamily
from model.fit.problem import Problem
from model.fit.result import Weakness
from model.fit.uncertainty import Uncertainty
from model.geometry import FloatArray, in_plane

_ONE = np.zeros(1, np.int64)


def weakness(
    family: SurfaceFamily, data: Dataset, x: FloatArray, names: tuple[str, ...], known: Uncertainty
) -> Weakness | None:
    """The combination of parameters that data notice least; None if there are fewer than two.

    Parameters
    ----------
    family : SurfaceFamily
        What was fitted.
    data : Dataset
        To what; a further reading is taken to have the errors of its middle rows.
    x : ndarray
        Shape (P,), the optimum.
    names : tuple of str
        The parameters with a standard error.
    known : Uncertainty
        How well the data determine these.
    """
    if len(names) < 2:
        return None
    exit_deg = np.arange(-80.0, 81.0)
    exit_rad, azimuth_rad = in_plane(np.radians(exit_deg))
    incidence_rad = np.full(len(exit_rad), np.median(data.incidence_rad))
    middle = np.median(np.moveaxis(data.whitener, 0, -1), axis=-1, keepdims=True)[None]
    whitener = np.broadcast_to(middle, (*middle.shape[:-1], len(exit_rad)))
    elsewhere = Problem(
        family.in_single_directions(),
        data.observable,
        (incidence_rad, exit_rad, azimuth_rad),
        np.zeros((1, middle.shape[1], len(exit_rad))),
        whitener,
    )
    with np.errstate(invalid="ignore", over="ignore"):  # where nothing is seen, or a pole is, nothing is told
        rows = elsewhere.difference(x[None], _ONE).jacobian[0][[family.names.index(name) for name in names]]
        change = (known.weakest @ rows)[: middle.shape[1] * len(exit_rad)].reshape(middle.shape[1], -1)
        told = np.nan_to_num((change * change).sum(axis=0), posinf=0.0)
    return Weakness(dict(zip(names, known.weakest.tolist(), strict=True)), float(np.radians(exit_deg[np.argmax(told)])))
