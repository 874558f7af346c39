"""A surface: the sum of exactly the lobes it is made of."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from model.evaluation import Addend, Light, Program, evaluate
from model.lobes import Diffuse, Directional, Lobe, Specular
from model.mirror_direction import require_off_mirror
from model.mueller import UNPOLARIZED
from model.stokes import is_unpolarized, require_stokes


class Surface:
    """Polarimetric reflectance of a flat, isotropically rough surface, eq. (5) of Hao et al. 2023.

    Parameters
    ----------
    lobes : sequence of Lobe
        What reflects; a lobe that is not named costs nothing.

    Raises
    ------
    ValueError
        If there is no lobe.
    """

    def __init__(self, lobes: Sequence[Lobe]) -> None:
        if not lobes:
            raise ValueError("A surface needs at least one lobe; none was given.")
        self.lobes = tuple(lobes)
        self._programs: dict[tuple[Light, tuple[str, ...]], Program] = {}

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the parameters that `jacobian` takes."""
        return tuple(dict.fromkeys(name for lobe in self.lobes for name in lobe.parameters))

    def mueller(self, incidence_rad: ArrayLike, exit_rad: ArrayLike, azimuth_rad: ArrayLike) -> NDArray[np.floating]:
        """Mueller matrices F in 1/sr: outgoing radiance = F · Stokes irradiance of the beam · cos(incidence).

        Parameters
        ----------
        incidence_rad, exit_rad : array_like
            Angles from the normal, 0 to pi/2; at the horizon itself the result is 0.
        azimuth_rad : array_like
            phi_r - phi_i; pi is the mirror side. All three broadcast; float32 arrays are computed with in single
            precision.

        Returns
        -------
        ndarray
            Shape (..., 4, 4), from the s-frame of the incoming to the s-frame of the outgoing ray.

        Raises
        ------
        ValueError
            If an angle is outside its range, or in the mirror direction itself after more than one bounce.
        """
        self._require_no_pole(incidence_rad, exit_rad, azimuth_rad)
        elements = evaluate(self._program("mueller"), self._numbers, incidence_rad, exit_rad, azimuth_rad)
        return np.moveaxis(elements.reshape(4, 4, *elements.shape[1:]), (0, 1), (-2, -1))

    def stokes(
        self,
        incidence_rad: ArrayLike,
        exit_rad: ArrayLike,
        azimuth_rad: ArrayLike,
        incoming: ArrayLike = UNPOLARIZED,
    ) -> NDArray[np.floating]:
        """Stokes vectors in 1/sr, F times the incoming Stokes vector, without building F.

        Parameters
        ----------
        incidence_rad, exit_rad, azimuth_rad : array_like
            As for `mueller`.
        incoming : array_like
            Stokes vector (4,) or (..., 4) in the s-frame of the incoming ray; unpolarized light by default.

        Returns
        -------
        ndarray
            Shape (..., 4).

        Raises
        ------
        ValueError
            As for `mueller`, or if the Stokes vector has not four elements.
        """
        state = require_stokes(incoming)
        self._require_no_pole(incidence_rad, exit_rad, azimuth_rad)
        if is_unpolarized(state):
            elements = evaluate(self._program("unpolarized"), self._numbers, incidence_rad, exit_rad, azimuth_rad)
            elements = elements if state[0] == 1.0 else elements * state[0].astype(elements.dtype)
        else:
            elements = evaluate(self._program("stokes"), self._numbers, incidence_rad, exit_rad, azimuth_rad, state)
        return np.moveaxis(elements, 0, -1)

    def jacobian(
        self,
        parameters: Sequence[str],
        incidence_rad: ArrayLike,
        exit_rad: ArrayLike,
        azimuth_rad: ArrayLike,
        incoming: ArrayLike = UNPOLARIZED,
    ) -> NDArray[np.floating]:
        """Derivatives of `stokes` by parameters, exact to rounding.

        A parameter that several lobes have, such as sigma, changes in all of them. Where two branches of the model meet
        the derivative is that of the branch whose value is taken.

        Parameters
        ----------
        parameters : sequence of str
            Any of `Surface.parameters`.
        incidence_rad, exit_rad, azimuth_rad, incoming
            As for `stokes`.

        Returns
        -------
        ndarray
            Shape (..., 4, parameters).

        Raises
        ------
        ValueError
            As for `stokes`, or if the surface has no parameter of that name.
        """
        names = require_parameters(parameters, self.parameters)
        state = require_stokes(incoming)
        self._require_no_pole(incidence_rad, exit_rad, azimuth_rad)
        unpolarized = is_unpolarized(state)
        program = self._program("unpolarized" if unpolarized else "stokes", names)
        numbers = {**self._numbers, **_as_inputs(self._rates(names))}
        given = None if unpolarized else state
        elements = evaluate(program, numbers, incidence_rad, exit_rad, azimuth_rad, given)
        if unpolarized and state[0] != 1.0:
            elements = elements * state[0].astype(elements.dtype)
        return np.moveaxis(elements.reshape(len(names), 4, *elements.shape[1:]), (0, 1), (-1, -2))

    def describe(self) -> str:
        """What the surface consists of, what was left out and why, one paragraph a lobe."""
        paragraphs = [lobe.describe() for lobe in self.lobes]
        absent = [
            name
            for kind, name in ((Specular, "specular"), (Diffuse, "diffuse"), (Directional, "directional diffuse"))
            if not any(isinstance(lobe, kind) for lobe in self.lobes)
        ]
        if absent:
            paragraphs.append(f"Left out because not asked for: {', '.join(absent)} lobe.")
        return "\n".join(paragraphs)

    @cached_property
    def _wiring(self) -> tuple[tuple[tuple[str, str], ...], ...]:
        # Lobes that share a number, as all do that have one sigma, take it from one input, and share what follows.
        sources: dict[tuple[str, float], str] = {}
        wiring = []
        for lobe in self.lobes:
            pairs = []
            for name, value in lobe.numbers.items():
                taken = sum(known == name for known, _ in sources)
                source = sources.setdefault((name, value), f"{name}.{taken}")
                pairs.append((name, source))
            wiring.append(tuple(pairs))
        return tuple(wiring)

    @cached_property
    def _numbers(self) -> dict[str, float]:
        return {
            source: lobe.numbers[name]
            for lobe, pairs in zip(self.lobes, self._wiring, strict=True)
            for name, source in pairs
        }

    def _rates(self, parameters: Sequence[str]) -> dict[tuple[str, str], float]:
        """How fast every input changes with every parameter, where it does."""
        rates: dict[tuple[str, str], float] = {}
        for parameter in parameters:
            for lobe, pairs in zip(self.lobes, self._wiring, strict=True):
                changing = lobe.rates(parameter, lobe.values)
                rates |= {(source, parameter): changing[name] for name, source in pairs if name in changing}
        return rates

    def _program(self, light: Light, varied: tuple[str, ...] = ()) -> Program:
        known = self._programs.get((light, varied))
        if known is None:
            addends = tuple(
                Addend(lobe.form(frozenset(varied)), pairs)
                for lobe, pairs in zip(self.lobes, self._wiring, strict=True)
            )
            rates = self._rates(varied)
            changes = tuple(
                tuple(
                    (source, rate_input(source, name, rates[source, name]))
                    for source in self._numbers
                    if (source, name) in rates
                )
                for name in varied
            )
            known = Program(addends, (*self._numbers, *_as_inputs(rates)), light, changes)
            self._programs[light, varied] = known
        return known

    def _require_no_pole(self, incidence_rad: ArrayLike, exit_rad: ArrayLike, azimuth_rad: ArrayLike) -> None:
        if any(lobe.has_caustic for lobe in self.lobes):
            require_off_mirror(incidence_rad, exit_rad, azimuth_rad)


def require_parameters(asked: Sequence[str], known: Sequence[str]) -> tuple[str, ...]:
    """The names of parameters as a tuple; ValueError if there is none, or one that a surface does not have."""
    names = tuple([asked] if isinstance(asked, str) else asked)
    if not names or any(name not in known for name in names):
        raise ValueError(f"parameters are {list(names)}; one or more are asked for, of this surface's {list(known)}.")
    return names


def rate_input(source: str, parameter: str, rate: float | NDArray[np.floating]) -> str | float:
    """How a program gets to know how fast an input changes with a parameter: 1 is in the formula, all else an input."""
    return 1.0 if isinstance(rate, float) and rate == 1.0 else f"{source} by {parameter}"


def _as_inputs(rates: dict[tuple[str, str], float]) -> dict[str, float]:
    return {
        name: rate
        for (source, parameter), rate in rates.items()
        if isinstance(name := rate_input(source, parameter, rate), str)
    }
