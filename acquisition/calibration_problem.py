"""The readings of references as one system of equations: what they should be, and what they depend on.

A reading through slot k of the light of state j of the reference is dark + power_j · a_k · s_j, with a_k the slot's row
(`calibrated_slots`) and s_j the light over its S0. The power of every state is solved for, so that neither the sample's
brightness nor the lamp's drift from state to state matters; so are the dark power of every scan, and what the light
depends on (`Known`), each held by a term of its own as well as it is known. The open slot's row is [1, 0, 0]; without
one, the transmission of the first slot is 1, because only ratios of powers are seen.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from acquisition.calibrated_slots import PARAMETERS, slot_row, slot_row_slopes
from acquisition.detector_noise import NoiseModel
from acquisition.readings import Reading
from acquisition.reference_light import ReferenceLight
from goniometer.errors import ReductionError

Floats = NDArray[np.float64]

_STEP = 1e-4
"""Of a deviation in its standard errors, for derivatives of light."""


@dataclass(frozen=True)
class CalibrationScan:
    """The readings of one scan, with the light that they are of.

    `setting_deg` is where the reference was set to by hand, None if nothing is.
    """

    name: str
    reference: ReferenceLight
    setting_deg: float | None
    readings: tuple[Reading, ...]


class CalibrationProblem:
    """All readings, and what they depend on, as one vector of unknowns.

    The unknowns are, in this order: the slots' parameters, the power of each state in units of `scale_w`, the dark
    power of each scan in the same unit, and what is known of the references, as deviations in its own standard errors.
    """

    def __init__(self, scans: Sequence[CalibrationScan]) -> None:
        self.scans = scans
        self.readings = [(number, reading) for number, scan in enumerate(scans) for reading in scan.readings]
        first = [reading for _, reading in self.readings]
        nominal = {r.slot: r.analyzer_deg for r in first if r.kind == "signal" and r.analyzer_deg is not None}
        self.nominal_deg = dict(sorted(nominal.items()))
        self.slots = tuple(self.nominal_deg)
        opens = {r.slot for r in first if r.kind == "signal" and r.analyzer_deg is None}
        if not self.slots:
            raise ReductionError("No reading was taken behind a polarizer: there is nothing to calibrate.")
        self.open_slot = min(opens) if opens else None
        self.has_dark = all(any(r.kind == "dark" for r in scan.readings) for scan in scans)
        self.states = sorted({(number, r.point) for number, r in self.readings if r.kind == "signal"})
        self._known = _known(scans)
        self._power_w = np.array([r.power_w for r in first])
        self._exposure_s = np.array([r.exposure_s for r in first])
        self.scale_w = float(np.abs(self._power_w).max()) or 1.0
        place = {state: index for index, state in enumerate(self.states)}
        self.state_of = np.array([place[number, r.point] if r.kind == "signal" else -1 for number, r in self.readings])
        self.slot_of = np.array([self.slots.index(r.slot) if r.slot in self.slots else -1 for r in first])
        self.scan_of = np.array([number for number, _ in self.readings])
        self._half_deg = [self._half_angle_deg(state) for state in self.states]
        self.powers = 3 * len(self.slots)
        self.darks = self.powers + len(self.states)
        self.deviations = self.darks + (len(scans) if self.has_dark else 0)
        self.count = self.deviations + len(self._known)

    @property
    def fixed(self) -> int | None:
        """Which unknown is 1 by definition: the first slot's transmission, where there is no open slot."""
        return None if self.open_slot is not None else PARAMETERS.index("transmission")

    def name(self, unknown: int) -> str:
        """A slot's parameter in words."""
        slot = self.slots[unknown // 3]
        what = ("angle", "extinction", "transmission")[unknown % 3]
        return f"the {what} of slot {slot} ({self.nominal_deg[slot]:g} deg)"

    def start(self) -> Floats:
        """The slots as the rig file has them, and the powers that follow."""
        unknowns = np.zeros(self.count)
        for index, angle_deg in enumerate(self.nominal_deg.values()):
            unknowns[3 * index : 3 * index + 3] = angle_deg, 0.0, 1.0
        unknowns[self.powers : self.darks] = 1.0
        model, slopes = self._model(unknowns)
        linear = slopes[:, self.powers : self.deviations]
        others = model - linear @ unknowns[self.powers : self.deviations]
        unknowns[self.powers : self.deviations] = np.linalg.lstsq(linear, self._power_w / self.scale_w - others)[0]
        return unknowns

    def weighted(self, unknowns: Floats, noise: NoiseModel) -> tuple[Floats, Floats]:
        """Residuals in standard deviations and derivatives of the model by the unknowns; what is known comes last."""
        model, slopes = self._model(unknowns)
        stddev = np.sqrt(noise.variance(model * self.scale_w, self._exposure_s)) / self.scale_w
        deviations = np.eye(self.count)[self.deviations :]
        held = np.array([stderr > 0.0 for _, stderr in self._known.values()], dtype=bool)
        slopes = np.vstack([slopes / stddev[:, None], deviations[held]])
        residuals = (self._power_w / self.scale_w - model) / stddev
        return np.concatenate([residuals, -unknowns[self.deviations :][held]]), self._without_fixed(slopes)

    def _model(self, unknowns: Floats) -> tuple[Floats, Floats]:
        """Powers of all readings in units of `scale_w`, and their derivatives by the unknowns."""
        of_slots = unknowns[: self.powers].reshape(-1, 3)
        rows = np.array([*(slot_row(*values) for values in of_slots), [1.0, 0.0, 0.0]])  # the last one is the open slot
        powers = unknowns[self.powers : self.darks]
        light, light_slopes = self._light(unknowns[self.deviations :])
        lit = self.state_of >= 0
        state, slot = self.state_of[lit], self.slot_of[lit]
        model, slopes = np.zeros(len(lit)), np.zeros((len(lit), self.count))
        shares = np.einsum("ij,ij->i", rows[slot], light[state])
        model[lit] = powers[state] * shares
        slopes[lit, self.powers + state] = shares
        slopes[np.ix_(lit, np.arange(self.deviations, self.count))] = powers[state, None] * np.einsum(
            "ij,ijk->ik", rows[slot], light_slopes[state]
        )
        for index, values in enumerate(of_slots):
            here = lit & (self.slot_of == index)
            of_state = self.state_of[here]
            slopes[np.ix_(here, range(3 * index, 3 * index + 3))] = (
                powers[of_state, None] * light[of_state] @ slot_row_slopes(*values).T
            )
        if self.has_dark:
            darks = self.darks + self.scan_of
            model += unknowns[darks]
            slopes[np.arange(len(lit)), darks] = 1.0
        return model, slopes

    def _light(self, deviations: Floats) -> tuple[Floats, Floats]:
        """The states' light (J, 3), and its derivatives (J, 3, D) by the deviations of what is known."""
        light = np.array([self._light_of(index, deviations) for index in range(len(self.states))])
        slopes = np.zeros((*light.shape, len(deviations)))
        for number in range(len(deviations)):
            step = _STEP * np.eye(len(deviations))[number]
            for index, (scan, _) in enumerate(self.states):
                if number in self._numbers(scan):
                    there, back = (self._light_of(index, deviations + sign * step) for sign in (1.0, -1.0))
                    slopes[index, :, number] = (there - back) / (2.0 * _STEP)
        return light, slopes

    def _light_of(self, index: int, deviations: Floats) -> Floats:
        number = self.states[index][0]
        scan, values = self.scans[number], list(self._known.values())
        known = [values[at][0] + values[at][1] * deviations[at] for at in self._numbers(number)]
        return scan.reference.light(scan.setting_deg, self._half_deg[index], np.array(known))

    def _numbers(self, scan: int) -> list[int]:
        """Which of all that is known the light of a scan depends on, in the order of its reference."""
        names = list(self._known)
        return [names.index(_key(scan, known.name, known.is_shared)) for known in self.scans[scan].reference.known()]

    def _half_angle_deg(self, state: tuple[int, int]) -> float:
        taken = [r for number, r in self.readings if (number, r.point) == state]
        return float(np.mean([(r.incidence_deg + r.exit_deg) / 2.0 for r in taken]))

    def _without_fixed(self, slopes: Floats) -> Floats:
        """An unknown that nothing is to change has no effect: least squares of smallest norm leaves it as it is."""
        if self.fixed is not None:
            slopes[:, self.fixed] = 0.0
        exact = [self.deviations + at for at, (_, stderr) in enumerate(self._known.values()) if stderr == 0.0]
        slopes[:, exact] = 0.0
        return slopes


def _key(scan: int, name: str, is_shared: bool) -> str:
    return name if is_shared else f"{name} in scan {scan}"


def _known(scans: Sequence[CalibrationScan]) -> dict[str, tuple[float, float]]:
    """Value and standard error of everything that the scans' light depends on, by name."""
    found: dict[str, tuple[float, float]] = {}
    for number, scan in enumerate(scans):
        for known in scan.reference.known():
            pair = known.value, known.stderr
            if found.setdefault(_key(number, known.name, known.is_shared), pair) != pair:
                raise ReductionError(
                    f"{scan.name}: {known.name} is {pair[0]:g} ± {pair[1]:g} here, and something else in another scan. "
                    "One calibration takes one reference of each kind: leave the scans of the other one out."
                )
    return found
