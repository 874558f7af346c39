"""What other programs take for the polarimetric reflectance of one direction: ``model_peers.py PEER`` prints JSON.

Two are libraries for single reflections off a rough metal: Mitsuba (Mueller matrices out of unit vectors) and SCATMECH
(Mueller matrices, one direction a call). The others are compilers put to the project's own problem, three lobes under
unpolarized light: S0, S1, S2 out of angles. ``numba-2`` and ``jax-2`` add the second bounce.

``import_s`` comes on top of numpy's own; ``first_call_s`` goes from there to the first result. Compiled code is kept
in the environment (Mitsuba's in ~/.drjit): from the second run on this is the time with a warm cache. In .venv-bench.
"""

from __future__ import annotations

import argparse
import importlib
import json
import os
import statistics
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from directions import DIRECTION_SETS
from interleaved import ONE_CORE, seconds

SIGMA, INDEX, WEIGHTS = 0.2, 2.950 + 2.932j, (1.0, 0.1, 0.1)  # iron at 550 nm; rho_s, rho_d, rho_dd
SHORTEST_REPEAT_S, REPEATS = 0.02, 15
TINY = 1e-300
ENVIRONMENT = Path(sys.prefix)
LLVM = ENVIRONMENT / "lib" / "libLLVM.so"  # Mitsuba takes the system's where there is none here, if new enough
SETTINGS = {  # read by the peers when they are imported
    "NUMBA_CACHE_DIR": str(ENVIRONMENT / "cache"),
    "JAX_COMPILATION_CACHE_DIR": str(ENVIRONMENT / "cache"),
    "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0",
    "JAX_ENABLE_X64": "true",
}


def mitsuba(incidence, exit_, azimuth, cores):
    import drjit
    import mitsuba

    mitsuba.set_variant("llvm_ad_mono_polarized")
    drjit.set_thread_count(cores)
    # Its alpha is Beckmann's m.
    material = {"distribution": "beckmann", "alpha": float(np.sqrt(2.0) * SIGMA), "eta": INDEX.real, "k": INDEX.imag}
    surface = mitsuba.load_dict({"type": "roughconductor", **material})
    context = mitsuba.BSDFContext()

    def unit_vectors(polar, azimuth):
        x, y, z = np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)
        return mitsuba.Vector3f(np.stack([x, y, z]).astype(np.float32))

    # Frozen functions replay their kernel instead of tracing Python again at every call: Mitsuba at its best.
    @drjit.freeze
    def mueller(source, detector):
        interaction = drjit.zeros(mitsuba.SurfaceInteraction3f)
        interaction.wi = source
        return surface.eval(context, interaction, detector)

    source, detector = unit_vectors(incidence, np.zeros_like(azimuth)), unit_vectors(exit_, azimuth)

    def evaluate():
        matrices = mueller(source, detector)
        drjit.eval(matrices)
        drjit.sync_thread()
        return matrices

    return evaluate


def pyscatmech(incidence, exit_, azimuth, cores):
    from pySCATMECH.brdf import BRDF_Model

    parameters = {
        "lambda": 0.55,
        "substrate": f"({INDEX.real},{INDEX.imag})",
        "sdf": "Gaussian_Slope_Distribution_Function",
        "sdf.s": float(np.sqrt(2.0) * SIGMA),
        "shadow": "Torrance_Sparrow_Shadow_Function",
    }
    surface = BRDF_Model("Shadowed_Facet_BRDF_Model", parameters)
    # Its azimuth is 0 on the mirror side.
    angles = list(zip(incidence.tolist(), exit_.tolist(), (azimuth - np.pi).tolist(), strict=True))
    return lambda: [surface.MuellerBRDF(*angle) for angle in angles]


def numba(stokes, incidence, exit_, azimuth, cores):
    import numba

    # NaN keeps its meaning; a division by zero is infinite, as in numpy, and no branch.
    options = {"error_model": "numpy", "fastmath": {"contract", "nsz", "arcp"}}
    for function in (if_else, fresnel, three_lobes, with_second_bounce):
        numba.extending.register_jitable(**options)(function)

    @numba.njit(parallel=True, cache=True, **options)
    def over_directions(incidence, exit_, azimuth, surface):
        result = np.empty((3, exit_.size))
        for j in numba.prange(exit_.size):
            result[0, j], result[1, j], result[2, j] = stokes(np, if_else, incidence[j], exit_[j], azimuth[j], surface)
        return result

    numba.set_num_threads(cores)
    surface = (SIGMA, INDEX.real, INDEX.imag, *WEIGHTS)
    return lambda: over_directions(incidence, exit_, azimuth, surface)


def jax(stokes, incidence, exit_, azimuth, cores):
    import jax

    compiled = jax.jit(partial(stokes, jax.numpy, jax.numpy.where))
    arguments = jax.device_put((incidence, exit_, azimuth, (SIGMA, INDEX.real, INDEX.imag, *WEIGHTS)))
    return lambda: jax.block_until_ready(compiled(*arguments))


def if_else(condition, yes, no):
    return yes if condition else no


def fresnel(xp, choose, cos_facet, sin2_facet, n, k):
    """Give z and scale of r_s = e (z + sin²), -r_p = e (z - sin²), |e|² = scale; nothing that matters cancels."""
    contrast_re, contrast_im = (n - 1.0) * (n + 1.0) - k * k, 2.0 * n * k
    q = contrast_re + cos_facet * cos_facet
    larger = xp.sqrt((xp.sqrt(q * q + contrast_im * contrast_im) + abs(q)) / 2.0)
    smaller = contrast_im / (2.0 * xp.maximum(larger, TINY))
    d_re, d_im = choose(q >= 0.0, larger, smaller), choose(q >= 0.0, smaller, larger)
    z_re, z_im = cos_facet * d_re, cos_facet * d_im
    sum2 = xp.maximum((cos_facet + d_re) ** 2 + d_im * d_im, TINY)
    r_s2 = (contrast_re * contrast_re + contrast_im * contrast_im) / (sum2 * sum2)
    return z_re, z_im, r_s2 / ((z_re + sin2_facet) ** 2 + z_im * z_im)


def three_lobes(xp, choose, incidence, exit_, azimuth, surface):
    """S0, S1, S2 of eqs. (6), (8) and (10) of Hao et al. 2023 in 1/sr, one bounce, unpolarized light."""
    sigma, n, k, rho_s, rho_d, rho_dd = surface
    cos_i, cos_r, sin_i, sin_r = xp.cos(incidence), xp.cos(exit_), xp.sin(incidence), xp.sin(exit_)
    sin_h, cos_h = xp.sin((incidence + exit_) / 2.0), xp.cos((incidence + exit_) / 2.0)
    sin_d, cos_d = xp.sin((incidence - exit_) / 2.0), xp.cos((incidence - exit_) / 2.0)
    sin_f, cos_f = xp.sin(azimuth / 2.0), xp.cos(azimuth / 2.0)
    cos_phi, sin_phi, versine = (cos_f - sin_f) * (cos_f + sin_f), 2.0 * sin_f * cos_f, 2.0 * sin_f * sin_f

    # i + r, i - r and i × r out of half angles: sums of vectors lose their digits near the mirror direction.
    sum_x, y, sum_z = 2.0 * (cos_h * sin_d + sin_r * cos_f * cos_f), sin_r * sin_phi, 2.0 * cos_h * cos_d
    difference_x, difference_z = 2.0 * cos_h * sin_d + sin_r * versine, -2.0 * sin_h * sin_d
    rho2 = sum_x * sum_x + y * y
    cos2_facet = (rho2 + sum_z * sum_z) / 4.0
    sin2_facet = (difference_x * difference_x + y * y + difference_z * difference_z) / 4.0
    s_x, s_y = sin_i * cos_r * versine - 2.0 * sin_d * cos_d, sin_i * sin_phi
    s2 = xp.maximum(s_x * s_x + s_y * s_y, TINY)

    slope2 = rho2 / (sum_z * sum_z)
    masked = xp.minimum(1.0 / xp.minimum(cos_i, cos_r), sum_z / cos2_facet) / xp.maximum(cos_i, cos_r)
    density = xp.exp(-slope2 / (2.0 * sigma * sigma)) * (1.0 + slope2) ** 2 / (2.0 * np.pi * sigma * sigma)
    directional = xp.exp(-2.0 * sin_r / (cos_r * sigma * sigma)) / (np.sqrt(2.0 * np.pi) * sigma)
    bracket = 0.8532 * sigma**-0.095 * cos_i * cos_r + 0.3595 * sigma**1.785 * sin_i * sin_r * cos_phi
    diffuse = rho_d / np.pi * masked * xp.maximum(bracket, 0.0)
    z_re, z_im, scale = fresnel(xp, choose, xp.sqrt(cos2_facet), sin2_facet, n, k)
    polarized = (rho_s * density * masked / 4.0 + rho_dd * directional) * scale
    s1 = 2.0 * polarized * sin2_facet * z_re / s2
    s0 = diffuse + polarized * (z_re * z_re + sin2_facet * sin2_facet + z_im * z_im)
    return s0, s1 * (s_x - s_y) * (s_x + s_y), s1 * 2.0 * s_x * s_y


def with_second_bounce(xp, choose, incidence, exit_, azimuth, surface):
    """`three_lobes` and the light that meets both walls of symmetric grooves."""
    s0, s1, s2 = three_lobes(xp, choose, incidence, exit_, azimuth, surface)
    sigma, n, k, rho_s, _, _ = surface
    cos_i, cos_r, sin_i, sin_r = xp.cos(incidence), xp.cos(exit_), xp.sin(incidence), xp.sin(exit_)
    mean, half = (incidence + exit_) / 2.0, (incidence - exit_) / 2.0
    sum_x = 2.0 * (xp.cos(mean) * xp.sin(half) + sin_r * xp.cos(azimuth / 2.0) ** 2)
    sum_y, sum_z = sin_r * xp.sin(azimuth), 2.0 * xp.cos(mean) * xp.cos(half)
    rho = xp.maximum(xp.sqrt(sum_x * sum_x + sum_y * sum_y), 1e-150)
    s_x, s_y = sum_x / rho, sum_y / rho

    # Across the grooves: H and D are half the sum and half the difference of the angles of i and r to the normal.
    cross, along = xp.sin(2.0 * half) * xp.sin(2.0 * mean), rho * sum_z
    hypotenuse = xp.sqrt(cross * cross + along * along)
    length = xp.sqrt(rho * rho + sum_z * sum_z) * hypotenuse / (2.0 * along)
    half_sum, complement = xp.arctan2(rho, sum_z), xp.arctan2(along, abs(cross))
    in_plane = xp.sqrt(s_x * s_x + cos_i * cos_i * s_y * s_y)
    axial, cos_first, sin_first = sin_i * s_y, cos_i / in_plane, sin_i * s_x / in_plane
    x, y = -cos_r * (xp.cos(azimuth) * s_y - xp.sin(azimuth) * s_x), xp.cos(azimuth) * s_x + xp.sin(azimuth) * s_y
    cos2, sin2 = (x - y) * (x + y) / (x * x + y * y), 2.0 * x * y / (x * x + y * y)

    # The flatter groove's slope is the inverse of the steeper one's.
    steep_slope, signed = (hypotenuse + abs(cross)) / along, np.pi / 2.0 - complement
    for slope, total, last, side in (
        (steep_slope, complement, complement / 2.0 - half_sum + signed, 1.0),
        (1.0 / steep_slope, np.pi - complement, complement / 2.0 - half_sum, -1.0),
    ):
        facing = choose(cross < 0.0, -side, side)
        wall2 = 1.0 + slope * slope
        unmet = 2.0 * along / hypotenuse * xp.sin(total / 2.0 - half_sum)
        share = xp.sqrt(wall2) / 2.0 * xp.maximum(xp.minimum(xp.sin(last), unmet), 0.0) * length
        lit = rho_s * xp.exp(-slope * slope / (2.0 * sigma * sigma)) / (2.0 * np.pi * sigma * sigma)
        lit = lit * share * slope * wall2 / (2.0 * rho * cos_i * cos_r)

        cosine = 1.0 / xp.sqrt(wall2)
        sine = slope * cosine
        cos = cos_first * cosine + facing * sin_first * sine
        sin = sin_first * cosine - facing * cos_first * sine
        across = axial * cos
        a_re, a_im, a_scale = fresnel(xp, choose, length * cos, across * across + sin * sin, n, k)
        a1, a2 = (across - sin) * (across + sin), -2.0 * across * sin
        turn_cos, turn_sin = sine * sine - cosine * cosine, facing * 2.0 * sine * cosine
        cos, sin = cos * turn_cos - sin * turn_sin, sin * turn_cos + cos * turn_sin
        across = axial * cos
        b_re, b_im, b_scale = fresnel(xp, choose, length * cos, across * across + sin * sin, n, k)
        b1, b2 = (across - sin) * (across + sin), -2.0 * across * sin

        # Jones matrices b·a as n0 + n1 σ_z + n2 σ_x + w σ_zσ_x, of which w alone is real.
        n0_re, n0_im = b_re * a_re - b_im * a_im + b1 * a1 + b2 * a2, b_re * a_im + b_im * a_re
        n1_re, n1_im = b_re * a1 + b1 * a_re, b_im * a1 + b1 * a_im
        n2_re, n2_im = b_re * a2 + b2 * a_re, b_im * a2 + b2 * a_im
        w = b1 * a2 - b2 * a1
        lit = lit * a_scale * b_scale
        t1 = 2.0 * lit * (n0_re * n1_re + n0_im * n1_im + n2_re * w)
        t2 = 2.0 * lit * (n0_re * n2_re + n0_im * n2_im - n1_re * w)
        size2 = n0_re * n0_re + n0_im * n0_im + n1_re * n1_re + n1_im * n1_im + n2_re * n2_re + n2_im * n2_im + w * w
        s0, s1, s2 = s0 + lit * size2, s1 + cos2 * t1 - sin2 * t2, s2 + cos2 * t2 + sin2 * t1
    return s0, s1, s2


class Peer(NamedTuple):
    """How to have a peer evaluate the directions: its module, and build(incidence, exit, azimuth, cores)."""

    module: str
    precision: str
    build: Callable[..., Callable[[], object]]


PEERS = {
    "mitsuba": Peer("mitsuba", "float32", mitsuba),
    "pyscatmech": Peer("pySCATMECH.brdf", "float64", pyscatmech),
    "numba": Peer("numba", "float64", partial(numba, three_lobes)),
    "numba-2": Peer("numba", "float64", partial(numba, with_second_bounce)),
    "jax": Peer("jax", "float64", partial(jax, three_lobes)),
    "jax-2": Peer("jax", "float64", partial(jax, with_second_bounce)),
}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("peer", choices=PEERS)
    parser.add_argument("--set", choices=DIRECTION_SETS, default="random")
    parser.add_argument("--directions", type=int, default=100_000)
    parser.add_argument("--cores", type=int, default=1)
    arguments = parser.parse_args()
    if hasattr(os, "sched_setaffinity"):  # XLA has no other way to be told
        os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[: arguments.cores])
    os.environ.update(SETTINGS)
    if LLVM.exists():
        os.environ.setdefault("DRJIT_LIBLLVM_PATH", str(LLVM))
    peer = PEERS[arguments.peer]
    angles = [angle.ravel() for angle in np.broadcast_arrays(*DIRECTION_SETS[arguments.set](arguments.directions))]

    start = time.perf_counter()
    importlib.import_module(peer.module)
    import_s = time.perf_counter() - start
    start = time.perf_counter()
    evaluate = peer.build(*angles, arguments.cores)
    evaluate()
    first_call_s = time.perf_counter() - start
    clock = ONE_CORE if arguments.cores == 1 else time.perf_counter
    calls = max(1, round(SHORTEST_REPEAT_S / seconds(evaluate, 1, clock)))
    repeats = [seconds(evaluate, calls, clock) / calls for _ in range(REPEATS)]
    figures = {
        "peer": arguments.peer,
        "precision": peer.precision,
        "set": arguments.set,
        "directions": arguments.directions,
        "cores": arguments.cores,
        "ns_per_direction": round(1e9 * statistics.median(repeats) / arguments.directions, 3),
        "import_s": round(import_s, 3),
        "first_call_s": round(first_call_s, 3),
    }
    print(json.dumps(figures))


if __name__ == "__main__":
    main()
