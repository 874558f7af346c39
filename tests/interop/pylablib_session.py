"""Drives a bench's APT controller, Elliptec modules and filter wheel with pylablib; run in the clients' environment.

Arguments: pairs of ``kinesis``, ``kinesis_rack``, ``elliptec`` or ``wheel`` and an address. Prints one JSON object.
"""

import json
import sys

from pylablib.devices import Thorlabs

K10CR1_SCALE = (49_152_000 / 360, 7_329_109, 1502.03)
HDR50_SCALE = (75_091, 4_030_885, 826)


def drive_kinesis(address, scale=K10CR1_SCALE, **options):
    motor = Thorlabs.KinesisMotor(("serial", address), scale=scale, **options)
    found = {"model": motor.get_device_info().model_no, "homed at first": motor.is_homed()}
    motor.home()
    found |= {"homed": motor.is_homed(), "home": motor.get_position()}
    motor.setup_velocity(max_velocity=8.0, acceleration=15.0)
    found["velocity"] = motor.get_velocity_parameters()[1:]
    motor.move_to(12.5)
    motor.wait_move()
    found["position"] = motor.get_position()
    motor.move_by(-20.0)
    motor.wait_move()
    found["other position"] = motor.get_position()
    motor.jog("+")
    found["jogs"] = motor.is_moving()
    motor.stop()
    found["status after stop"] = motor.get_status()
    motor.close()
    return found


def drive_kinesis_rack(address):
    return drive_kinesis(address, HDR50_SCALE, is_rack_system=True)


def drive_elliptec(address):
    line = Thorlabs.ElliptecMotor(("serial", address))
    modules = {}
    for module in line.get_connected_addrs():
        info = line.get_device_info(addr=module)
        found = {"type": info.model_no, "travel": info.travel, "pulses": info.pulse}
        found["home"] = [line.home(addr=module), line.get_position(addr=module)]
        if info.travel == 360:
            found["moves"] = []
            for move, way in ((line.move_to, 45.0), (line.move_by, -90.0)):
                arrived = move(way, addr=module)
                found["moves"].append([arrived, line.get_position(addr=module)])
            found["velocity"] = line.set_velocity(60, addr=module)
        else:
            found["forward"] = int(line.query("fw", addr=module, reply_comm="PO").data, 16)
        found["status"] = line.get_status(addr=module)
        modules[module] = found
    line.close()
    return modules


def turn_wheel(address):
    wheel = Thorlabs.FW(("serial", address))
    found = {"slots": wheel.get_pcount(), "id": wheel.get_id()}
    wheel.set_position(3)
    found["slot"] = wheel.get_position()
    wheel.close()
    return found


SESSIONS = {
    "kinesis": drive_kinesis,
    "kinesis_rack": drive_kinesis_rack,
    "elliptec": drive_elliptec,
    "wheel": turn_wheel,
}

if __name__ == "__main__":
    kinds, addresses = sys.argv[1::2], sys.argv[2::2]
    print(json.dumps({kind: SESSIONS[kind](address) for kind, address in zip(kinds, addresses, strict=True)}))
