"""Axes that do not arrive, and controllers that forget where they are."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar, Literal

from pydantic import Field

from sim_devices.faults.entry import AxisFault, MotionFault, Random
from sim_devices.faults.hooks import HasLimitSwitches, LosesHome, LosesPower, Resets

if TYPE_CHECKING:
    from sim_devices.faults.switchboard import Switchboard


class Stall(MotionFault):
    """An axis that something holds up while its controller goes on driving it."""

    fault: Literal["stall"] = Field(description="the fault's name")
    for_s: float = Field(default=600.0, gt=0, le=1e6, description="how long the controller drives it in vain, in s")

    def strike_in_motion(self, board: Switchboard, time_s: float) -> None:
        """Stand still."""
        board.world.axes[self.axis].hold_up(time_s, self.for_s)


class LimitHit(MotionFault):
    """An axis that meets its limit switch."""

    needs: ClassVar[tuple[type, ...]] = (HasLimitSwitches,)

    fault: Literal["limit_hit"] = Field(description="the fault's name")

    def strike_in_motion(self, board: Switchboard, time_s: float) -> None:
        """Stop, as the controller does then."""
        controller = board.turning(self)
        assert isinstance(controller, HasLimitSwitches)
        controller.hit_limit(board.world.axes[self.axis], time_s)


class ResetInMotion(MotionFault):
    """A controller that begins afresh while one of its axes moves; one without a reset loses power for a moment."""

    needs: ClassVar[tuple[type, ...]] = (Resets, LosesPower)

    fault: Literal["reset_in_motion"] = Field(description="the fault's name")

    def strike_in_motion(self, board: Switchboard, time_s: float) -> None:
        """Begin afresh."""
        controller = board.turning(self)
        if isinstance(controller, Resets):
            controller.reset(time_s)
        else:
            assert isinstance(controller, LosesPower)
            controller.power_cycle(time_s)


class LostHome(AxisFault):
    """A controller that forgets where the home position of an axis is."""

    needs: ClassVar[tuple[type, ...]] = (LosesHome,)

    fault: Literal["lost_home"] = Field(description="the fault's name")

    def strike(self, board: Switchboard, random: Random, time_s: float) -> None:
        """Forget it."""
        controller = board.turning(self)
        assert isinstance(controller, LosesHome)
        controller.lose_home(board.world.axes[self.axis], time_s)
