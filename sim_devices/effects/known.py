"""Every effect that a scene may name, in the order in which motors, light and electrons meet them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, Union

from pydantic import Field

from sim_devices.effects.arm_angle import Flexure, ZeroOffset
from sim_devices.effects.backlash import Backlash
from sim_devices.effects.cones import AcceptanceCone, SourceCone
from sim_devices.effects.dark_current import DarkCurrent
from sim_devices.effects.encoder import EncoderNoise, EncoderStep
from sim_devices.effects.entry import Effect
from sim_devices.effects.extinction import ExtinctionRatio
from sim_devices.effects.flicker import Flicker
from sim_devices.effects.lamp_drift import LampDrift, LampWalk
from sim_devices.effects.nonlinearity import Nonlinearity
from sim_devices.effects.polarized_lamp import PolarizedLamp
from sim_devices.effects.quantisation import Quantisation
from sim_devices.effects.read_noise import ReadNoise
from sim_devices.effects.reference_polarizer import ReferencePolarizer
from sim_devices.effects.saturation import Saturation
from sim_devices.effects.shot_noise import ShotNoise
from sim_devices.effects.slots import SlotAngleErrors, SlotTransmissions
from sim_devices.effects.stray_light import StrayLight
from sim_devices.effects.wobble import WheelWobble

IN_ORDER: tuple[type[Effect], ...] = (
    EncoderNoise,
    EncoderStep,
    Backlash,
    ZeroOffset,
    Flexure,
    PolarizedLamp,
    LampDrift,
    LampWalk,
    Flicker,
    SourceCone,
    AcceptanceCone,
    ReferencePolarizer,
    StrayLight,
    SlotAngleErrors,
    SlotTransmissions,
    ExtinctionRatio,
    WheelWobble,
    DarkCurrent,
    ShotNoise,
    Nonlinearity,
    ReadNoise,
    Saturation,
    Quantisation,
)


def name_of(kind: type[Effect]) -> str:
    """How a scene names an effect."""
    (name,) = kind.model_fields["effect"].annotation.__args__  # type: ignore[union-attr]
    return str(name)


if TYPE_CHECKING:
    AnyEffect = Effect
else:
    AnyEffect: Any = Annotated[Union[IN_ORDER], Field(discriminator="effect")]  # noqa: UP007 (made from a tuple)
