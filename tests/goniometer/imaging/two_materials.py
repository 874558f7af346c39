"""What a camera must see of iron and glass: features, light and polarization, from the model and vectors alone."""

from __future__ import annotations

import numpy as np

from model import materials
from model.lobes import Diffuse, Specular
from model.surface import Surface

DISTANCE_MM, INCIDENCE_DEG, WAVELENGTH_NM = 500.0, 60.0, 550.0
TRUTH = {
    "iron": {"sigma": 0.25, "rho_s": 0.7, "rho_d": 0.1},
    "glass": {"sigma": 0.3, "rho_s": 1.0, "rho_d": 0.05},
}
for _name, _material in (("iron", "Fe"), ("glass", "BK7")):
    _index = materials.index(_material, WAVELENGTH_NM)
    TRUTH[_name] |= {"n": _index.real, "k": _index.imag}
SURFACES = {
    name: Surface([Specular(of["rho_s"], of["sigma"], complex(of["n"], of["k"])), Diffuse(of["rho_d"], of["sigma"])])
    for name, of in TRUTH.items()
}


class Scene:
    """Glass with a disk of iron in it, on iron.

    Parameters
    ----------
    edge_mm : float
        Where the glass begins along x.
    disk_mm : tuple
        x, y and radius of the disk.
    half_mm : float
        The glass ends at y = ± so much, and beyond are markers.
    right_mm : float
        And at this x.
    """

    def __init__(self, edge_mm, disk_mm, half_mm, right_mm):
        self.edge_mm, self.disk_mm, self.half_mm, self.right_mm = edge_mm, disk_mm, half_mm, right_mm

    def of_material(self, x, y, margin_mm):
        """Where which material lies, with nothing else nearer than the margin."""
        from_disk = np.hypot(x - self.disk_mm[0], y - self.disk_mm[1])
        rows = np.abs(y) < self.half_mm - margin_mm
        glass = (x > self.edge_mm + margin_mm) & (x < self.right_mm - margin_mm)
        glass &= from_disk > self.disk_mm[2] + margin_mm
        return {"iron": rows & (x < self.edge_mm - margin_mm), "glass": rows & glass}

    def iron_share(self, s0, x, y, exit_deg):
        """How much of a pixel's light is iron's: neither material's own gradient is in it."""
        iron, glass = (stokes(name, x, y, exit_deg)[..., 0] for name in ("iron", "glass"))
        return (s0 - glass) / (iron - glass)

    def edge_px(self, s0, x, y, exit_deg):
        """By how many map pixels the edge between the materials lies off its place."""
        pixel_mm, from_edge = x[0, 1] - x[0, 0], x[0] - self.edge_mm
        columns, rows = np.abs(from_edge) < 2.5, np.abs(y[:, 0]) < 0.8 * self.half_mm
        share = self.iron_share(s0, x, y, exit_deg)[rows][:, columns].mean(axis=0)
        return share.sum() + (from_edge[columns][0] / pixel_mm - 0.5)

    def disk_px(self, s0, x, y, exit_deg):
        """By how many map pixels the disk's centroid lies off its place, along x and y."""
        pixel_mm = x[0, 1] - x[0, 0]
        off_x, off_y = x - self.disk_mm[0], y - self.disk_mm[1]
        around = np.hypot(off_x, off_y) < 1.4 * self.disk_mm[2]
        share = np.where(around, self.iron_share(s0, x, y, exit_deg), 0.0)
        return tuple((share * off).sum() / share.sum() / pixel_mm for off in (off_x, off_y))


def stokes(name, x, y, exit_deg):
    """True S0, S1, S2 of a material on the plate, (..., 3), counted from the picture's right."""
    exit_rad = np.radians(exit_deg)
    camera_mm = DISTANCE_MM * np.array([0.0, -np.sin(exit_rad), np.cos(exit_rad)])
    ray = camera_mm - np.stack([x, y, np.zeros_like(x)], axis=-1)
    ray /= np.linalg.norm(ray, axis=-1, keepdims=True)
    phi = np.arctan2(ray[..., 1], ray[..., 0]) - np.pi / 2
    own = SURFACES[name].stokes(np.full(x.shape, np.radians(INCIDENCE_DEG)), np.arccos(ray[..., 2]), phi)
    s = np.cross([0.0, 0.0, 1.0], ray)
    right = np.array([1.0, 0.0, 0.0]) - ray[..., :1] * ray
    up = np.cross(ray, right)
    turn = np.arctan2((s * up).sum(axis=-1), (s * right).sum(axis=-1))
    cos2, sin2 = np.cos(2 * turn), np.sin(2 * turn)
    return np.stack([own[..., 0], own[..., 1] * cos2 - own[..., 2] * sin2, own[..., 1] * sin2 + own[..., 2] * cos2], -1)


def dolp_of_mean(maps, row, where, noise_area_px):
    """DoLP of the mean light of an area in a direction, and its stated error."""
    mean = np.array([maps[name][row][where].mean(dtype=float) for name in ("S0", "S1", "S2")])
    covariance = np.empty((3, 3))
    for a in range(3):
        covariance[a, a] = (maps[f"S{a}_errors"][row][where].astype(float) ** 2).mean()
        for b in range(a + 1, 3):
            covariance[a, b] = covariance[b, a] = maps[f"S{a}_S{b}_covariance"][row][where].mean(dtype=float)
    covariance *= noise_area_px / np.count_nonzero(where)
    dolp = np.hypot(*mean[1:]) / mean[0]
    slope = np.array([-dolp, *(mean[1:] / (dolp * mean[0]))]) / mean[0]
    return dolp, float(np.sqrt(slope @ covariance @ slope))


def true_dolp(name, x, y, where, exit_deg):
    """The same of the truth."""
    s0, s1, s2 = stokes(name, x[where], y[where], exit_deg).mean(axis=0)
    return np.hypot(s1, s2) / s0
