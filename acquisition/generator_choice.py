"""What a recipe asks of the polarization state generator, and what is wrong with it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence

from acquisition.analyzer_matrix import check_states
from acquisition.generator import GeneratorState
from acquisition.section import SectionFault
from goniometer.errors import ReductionError

Angles = Sequence[float] | None


def generator_settings(polarizer_deg: Angles, retarder_deg: Angles) -> tuple[tuple[float, float | None], ...]:
    """The angles of polarizer and retarder, None without one, of each setting; none at all without a generator."""
    polarizer_deg = polarizer_deg or ()
    return tuple(zip(polarizer_deg, retarder_deg or (None,) * len(polarizer_deg), strict=True))


def generator_faults(polarizer_deg: Angles, retarder_deg: Angles) -> Iterator[SectionFault]:
    """What is wrong with the lists; of a retarder, what it tells depends on its retardance, which the rig knows."""
    if polarizer_deg is None:
        if retarder_deg is not None:
            yield ("generator_retarder_deg",), "needs generator_deg beside it; add it, or leave both out"
        return
    if retarder_deg is not None and len(retarder_deg) != len(polarizer_deg):
        yield (
            ("generator_retarder_deg",),
            f"got {len(retarder_deg)} angles; allowed: {len(polarizer_deg)}, one for each of generator_deg",
        )
        return
    key = ("generator_deg",) if retarder_deg is None else ("generator_retarder_deg",)
    settings = generator_settings(polarizer_deg, retarder_deg)
    twice = [setting for setting, times in Counter(settings).items() if times > 1]
    for setting in twice:
        yield key, f"the setting {GeneratorState(*setting)} stands {settings.count(setting)} times; allowed: each once"
    if retarder_deg is None and not twice:
        try:
            check_states([GeneratorState(angle_deg).reversed for angle_deg in polarizer_deg], element="generator")
        except ReductionError as error:
            yield key, str(error)


def purpose_faults(objective: str, *, adaptive: bool) -> Iterator[SectionFault]:
    """What a scan of Mueller matrices cannot be for."""
    if objective in ("dolp", "rms"):
        yield (
            ("fit", "objective"),
            f"got {objective}, which knows of unpolarized light alone; allowed with generator_deg: stokes (which "
            "compares all elements), normalised",
        )
    if adaptive:
        yield ("adaptive",), "plans by the Stokes parameters of unpolarized light; leave it out, or generator_deg"
