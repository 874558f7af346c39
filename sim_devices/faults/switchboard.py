"""Where faults are switched on, and all that they need to strike."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from goniometer.errors import ConfigurationError
from sim_devices.device import Device, Later, Session
from sim_devices.effects.measurement import seeded
from sim_devices.faults.entry import AxisFault, Fault
from sim_devices.faults.faulty_port import FaultyPort, FaultySession
from sim_devices.faults.hooks import Line
from sim_devices.modbus.tcp import ModbusTcp
from sim_devices.serving.clock import BenchClock
from sim_devices.serving.reactor import Reactor
from sim_devices.world import World


class Switchboard:
    """The faults of a bench.

    Parameters
    ----------
    world : World
        What faults of devices and light strike.
    ports : mapping of str to Device
        What answers at the port of each device; the same for devices that share a line.
    reactor : Reactor
        Serves the ports.
    clock : BenchClock
        The bench's time.
    """

    def __init__(self, world: World, ports: Mapping[str, Device], reactor: Reactor, clock: BenchClock) -> None:
        self.world = world
        self._ports, self._reactor, self._clock = ports, reactor, clock
        self._faulty: dict[Device, FaultyPort] = {}
        self._switched_on = 0

    def switch_on(self, fault: Fault) -> None:
        """Let a fault strike when its time has come.

        Raises
        ------
        ConfigurationError
            When the bench cannot have it.
        """
        if objections := self.objections(fault):
            raise ConfigurationError([f"{objection}. Nothing was switched on." for objection in objections])
        random = seeded(self.world.scene.seed, self._switched_on, fault.fault)
        self._switched_on += 1
        self.at(max(fault.at_s, self._clock.now()), lambda time_s: fault.strike(self, random, time_s))

    def objections(self, fault: Fault) -> tuple[str, ...]:
        """What keeps this bench from having a fault."""
        if found := fault.objections(self.world.scene.devices):
            return found
        if found := fault.objections_of(self.world.scene.plate):
            return found
        name = fault.device_name(self.world.scene.devices)
        device = self.device(name) if name else None
        if name and device is None:
            return (
                f"{name} is a {self.world.scene.devices[name].type}, which has no port where {fault.fault} could be",
            )
        if fault.needs and not isinstance(device, fault.needs):
            return (f"{name} is a {self.world.scene.devices[name].type}, to which {fault.fault} cannot happen",)
        return ()

    def at(self, time_s: float, act: Callable[[float], None]) -> None:
        """Let something happen at a time, before what is said later."""

        def act_once(due_s: float) -> tuple[()]:
            act(due_s)
            return ()

        self._reactor.at(time_s, act_once)

    def follow(self, time_s: float, act: Later) -> None:
        """Let something happen at a time, and then what it returns."""
        self._reactor.at(time_s, act)

    def port(self, name: str) -> FaultyPort:
        """What is wrong at the port of a device; from now on it stands between."""
        device = self._ports[name]
        if device not in self._faulty:
            self._faulty[device] = port = FaultyPort(is_virtual=self._clock.speed == "max")

            def stand_between(session: Session) -> Session | None:
                return None if self._clock.now() < port.refuses_until_s else FaultySession(session, port)

            self._reactor.stand_between(device, stand_between)
        return self._faulty[device]

    def say(self, name: str, data: bytes) -> None:
        """Let every client at a device's port hear something, unless its cable or its power is off."""
        if self._clock.now() >= self.port(name).deaf_until_s:
            self._reactor.say(self._ports[name], data)

    def cut(self, name: str, *, hangs_up: bool) -> None:
        """Lose all that is on its way to the clients of a device, and those that have a connection, if it hangs up."""
        self._reactor.cut(self._ports[name], hangs_up=hangs_up)

    def turn_off(self, name: str, until_s: float) -> None:
        """Let a device hear and say nothing until then; others on its line go on."""
        port = self._ports[name]
        if isinstance(port, Line):
            port.turn_off(self.device(name), until_s)
        else:
            self.port(name).deaf_until_s = until_s
            self.cut(name, hangs_up=False)

    def device(self, name: str) -> object:
        """A device itself, not the gateway before it; None for one without a port."""
        device = self.world.devices.get(name)
        return device.units[0] if isinstance(device, ModbusTcp) else device

    def turning(self, fault: AxisFault) -> object:
        """The device that turns a fault's axis."""
        return self.device(fault.device_name(self.world.scene.devices))
