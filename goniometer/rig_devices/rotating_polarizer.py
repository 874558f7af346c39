"""A polarizer, and perhaps a retarder before it, on one or two of the rig's rotators in a rig file."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from acquisition.analyzer_matrix import AnalyzerState
from acquisition.section import Section, SectionFault, refuse_all
from acquisition.timing import AnalyzerTiming, AxisTiming, JointTiming, RotatorTiming
from drivers.rotating_analyzer import RotatingAnalyzer, SlotAngles
from goniometer.rig_devices.connecting import Connecting
from goniometer.rig_devices.entry import AnalyzerEntry, Angle, AxisEntry, Role, Slot, angle_faults
from sim_devices.bench_devices.entry import SimulatedDevice
from sim_devices.bench_devices.rotating_polarizer import RotatingPolarizerDevice

Element = Literal["polarizer", "retarder"]


class Setting(Section):
    """The angles of polarizer and retarder, as a recipe names them; of a fixed element the same in every slot."""

    polarizer_deg: Angle = Field(description="angle of the transmitted polarization, in degrees")
    retarder_deg: Angle = Field(description="angle of the fast axis, in degrees")


class RotatingPolarizerEntry(AnalyzerEntry):
    """A polarizer, perhaps behind a retarder; what turns does so as the axis of that name of another device."""

    driver: Literal["rotating_polarizer"] = Field(description="the analyzer's kind")
    port: str = Field(default="", max_length=0, description="left out: the rotators have the ports")
    turns: Annotated[tuple[Element, ...], Field(strict=False)] = Field(
        default=("polarizer",),
        min_length=1,
        max_length=2,
        description="what turns, each as the axis of that name: polarizer, retarder, or both; the other one is fixed",
    )
    retardance_deg: float | None = Field(
        default=None,
        gt=0,
        lt=360,
        description="retardance of the retarder that the light passes before the polarizer, in degrees, 90 for a "
        "quarter-wave plate; leave out where there is none",
    )
    slots: dict[Annotated[int, Field(ge=1, le=64)], Angle | Setting] = Field(
        min_length=3,
        description="the angles that are used, in degrees, each under a number of your choice; with a retarder: "
        "{polarizer_deg, retarder_deg}",
    )

    @model_validator(mode="after")
    def _check(self) -> Self:
        refuse_all([*self._element_faults(), *self._slot_faults(), *angle_faults(self.contents())])
        return self

    def _element_faults(self) -> Iterator[SectionFault]:
        if len(set(self.turns)) < len(self.turns):
            yield ("turns",), f"names the {self.turns[0]} twice; allowed: polarizer, retarder, or both"
        if "retarder" in self.turns and self.retardance_deg is None:
            yield ("retardance_deg",), "is missing, but the retarder turns. Add it: 90 for a quarter-wave plate"

    def _slot_faults(self) -> Iterator[SectionFault]:
        first: dict[AnalyzerState, int] = {}
        for slot, content in self.slots.items():
            if isinstance(content, Setting) and self.retardance_deg is None:
                yield (
                    ("slots", slot),
                    "gives retarder_deg, but there is no retarder; add retardance_deg, or write one angle",
                )
            elif not isinstance(content, Setting) and self.retardance_deg is not None:
                yield (
                    ("slots", slot),
                    f"got {content:g}; allowed: both angles, {{polarizer_deg: {content:g}, retarder_deg: 0}} for "
                    "example, because the light always passes the retarder",
                )
        for slot, state in self.retarded().items():
            if first.setdefault(state, slot) != slot:
                yield ("slots", slot), f"holds the angles of slot {first[state]}; allowed: each pair once"
        yield from self._fixed_faults()

    def _fixed_faults(self) -> Iterator[SectionFault]:
        settings = {slot: content for slot, content in self.slots.items() if isinstance(content, Setting)}
        fixed: tuple[Element, ...] = ("polarizer", "retarder")
        for element in fixed:
            if element in self.turns or not settings:
                continue
            key = f"{element}_deg"
            first, *others = ((slot, getattr(content, key)) for slot, content in settings.items())
            for slot, angle_deg in others:
                if angle_deg != first[1]:
                    yield (
                        ("slots", slot, key),
                        f"got {angle_deg:g}; allowed: {first[1]:g}, as in slot {first[0]}, because turns does not name "
                        f"the {element}",
                    )

    def limit_faults(self, axes: Mapping[Role, AxisEntry]) -> Iterator[SectionFault]:
        """Slots that the rotators cannot reach, with what the approach from below needs."""
        for element in self.turns:
            role = self.role(element)
            if role not in axes:
                continue
            low_deg, high_deg = axes[role].travel.reachable_deg
            for slot, angle_deg in self._angles_deg(element).items():
                if not low_deg <= angle_deg <= high_deg:
                    yield (
                        ("slots", slot),
                        f"turns {role} to {angle_deg:g} degrees; allowed: {low_deg:g} to {high_deg:g}, its limits",
                    )

    @property
    def carried_by(self) -> tuple[Role, ...]:
        """The rotators."""
        return tuple(map(self.role, self.turns))

    def role(self, element: Element) -> Role:
        """The axis that turns an element."""
        return element

    def contents(self) -> Mapping[int, Slot]:
        """The angles of the polarizer where there is no retarder."""
        return {slot: content for slot, content in self.slots.items() if not isinstance(content, Setting)}

    def retarded(self) -> Mapping[int, AnalyzerState]:
        """The angles of polarizer and retarder."""
        return {
            slot: AnalyzerState(content.polarizer_deg, content.retarder_deg, self.retardance_deg)
            for slot, content in self.slots.items()
            if isinstance(content, Setting)
        }

    def timing(self, axes: Mapping[Role, AxisTiming]) -> AnalyzerTiming:
        """The rotators go from angle to angle, both at the same time."""
        return JointTiming(
            tuple(RotatorTiming(self._angles_deg(element), axes[self.role(element)]) for element in self.turns)
        )

    def connect(self, name: str, bench: Connecting) -> None:
        """Take the rotators, which are connected already."""
        angles_deg = {f"{element}_deg": self._angles_deg(element) for element in self.turns}
        slots = {
            slot: SlotAngles(**{key: of_slots[slot] for key, of_slots in angles_deg.items()}) for slot in self.slots
        }
        axes = {element: bench.axes[self.role(element)] for element in self.turns}
        self.give(name, bench, RotatingAnalyzer(axes.get("polarizer"), axes.get("retarder"), name=name, slots=slots))

    def give(self, name: str, bench: Connecting, driven: RotatingAnalyzer) -> None:
        """Take the connected device's place on the bench."""
        bench.analyzers[name] = driven

    def unlike(self, simulated: SimulatedDevice) -> Iterator[SectionFault]:
        """Whether the same elements turn, and both have a retarder or none."""
        assert isinstance(simulated, RotatingPolarizerDevice)
        if simulated.turns() != set(self.turns):
            there = " and ".join(sorted(simulated.turns())) or "nothing"
            yield ("type",), f"turns {there}; allowed: {' and '.join(sorted(self.turns))}"
        if (simulated.retardance_deg is None) != (self.retardance_deg is None):
            yield (
                ("retardance_deg",),
                "is given; allowed: no retarder" if self.retardance_deg is None else "is missing; allowed: a retarder",
            )

    def _angles_deg(self, element: Element) -> dict[int, float]:
        return {
            slot: getattr(content, f"{element}_deg") if isinstance(content, Setting) else content
            for slot, content in self.slots.items()
        }
