"""Drives a bench's ESP301 and PM100 with PyMeasure; run in the environment of requirements.txt.

Arguments: the addresses of the arms and of the meter. Prints one JSON object.
"""

import json
import sys

import serial
from pymeasure.adapters import SerialAdapter
from pymeasure.instruments.newport import ESP300
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


if __name__ == "__main__":
    print(json.dumps({"arms": drive_arms(sys.argv[1]), "meter": read_meter(sys.argv[2])}))
