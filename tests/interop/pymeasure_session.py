"""Drives a bench's ESP301, PM100 and SR830 with PyMeasure; run in the environment of requirements.txt.

Arguments: the addresses of the arms, of the meter and, where there is one, of the lock-in. Prints one JSON object.
"""

import json
import sys
import time

import serial
from pymeasure.adapters import SerialAdapter
from pymeasure.instruments.newport import ESP300
from pymeasure.instruments.srs import SR830
from pymeasure.instruments.thorlabs import ThorlabsPM100USB


def adapter(address, write_termination, read_termination):
    port = serial.serial_for_url(address, timeout=5)
    return SerialAdapter(port, write_termination=write_termination, read_termination=read_termination)


def drive_arms(address):
    controller = ESP300(adapter(address, "\r", "\r\n"))
    controller.clear_errors()
    found = {"units": controller.x.units, "limits": [controller.x.left_limit, controller.x.right_limit]}
    controller.x.enable()
    found["enabled"] = controller.x.enabled
    controller.x.position = 12.5
    controller.x.wait_for_stop()
    found["position"] = controller.x.position
    controller.y.enable()
    controller.y.position = -7.25
    controller.y.wait_for_stop()
    found["other position"] = controller.y.position
    controller.x.position = 1e6
    controller.x.write("XX")
    found["errors"] = [str(error) for error in controller.errors]
    found["position after refusal"] = controller.x.position
    return found


def read_meter(address):
    meter = ThorlabsPM100USB(adapter(address, "\n", "\n"))
    meter.wavelength = 550
    return {
        "id": meter.id,
        "sensor": meter.sensor_name,
        "wavelength": meter.wavelength,
        "power": meter.power,
    }


def read_lock_in(address):
    lock_in = SR830(adapter(address, "\r", "\r"))
    found = {"id": lock_in.id}
    lock_in.reset()
    lock_in.clear()
    lock_in.reference_source = "External"
    lock_in.sensitivity = 1
    lock_in.time_constant = 0.03
    lock_in.filter_slope = 24
    time.sleep(0.1)
    lock_in.auto_gain()
    while not int(lock_in.status) & 2:
        time.sleep(0.01)
    found |= {
        "settings": [lock_in.reference_source, lock_in.time_constant, lock_in.filter_slope, lock_in.input_config],
        "sensitivity": lock_in.sensitivity,
        "frequency": lock_in.frequency,
        "unlocked and changed": int(lock_in.lia_status),
        "settled": int(lock_in.lia_status),
        "snap": list(lock_in.snap("X", "Y", "R", "Theta", "Frequency")),
        "outputs": [lock_in.x, lock_in.y, lock_in.magnitude, lock_in.theta],
    }
    lock_in.sensitivity = found["sensitivity"] / 100
    found["overload"] = [int(lock_in.lia_status), lock_in.is_out_of_range()]
    lock_in.write("SENS 99")
    lock_in.write("NONE")
    found["errors"] = int(lock_in.ask("*ESR?"))
    lock_in.aux_out_1 = 2.5
    found["aux"] = [lock_in.aux_out_1, lock_in.aux_in_1, lock_in.aux_in_2]
    return found


def main(arms, meter, lock_in=None):
    found = {"arms": drive_arms(arms), "meter": read_meter(meter)}
    return found | {"lock-in": read_lock_in(lock_in)} if lock_in else found


if __name__ == "__main__":
    print(json.dumps(main(*sys.argv[1:])))
