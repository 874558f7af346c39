"""Drives a bench through PyVISA with its own back end, PyVISA-py; run in the environment of requirements.txt.

Arguments: the pseudo-terminals of the ESP301 and of the SR830, and the PM100's URL. Prints one JSON object.
"""

import json
import sys
from urllib.parse import urlsplit

import pyvisa
from pymeasure.instruments.newport import ESP300
from ThorlabsPM100 import ThorlabsPM100


def drive_arm(port):
    controller = ESP300(
        f"ASRL{port}::INSTR", visa_library="@py", baud_rate=19200, write_termination="\r", read_termination="\r\n"
    )
    controller.x.enable()
    controller.x.position = -3.75
    controller.x.wait_for_stop()
    found = {"position": controller.x.position, "errors": controller.errors}
    controller.x.disable()
    return found | {"enabled at last": controller.x.enabled}


def read_meter(manager, url):
    address = urlsplit(url)
    resource = manager.open_resource(
        f"TCPIP0::{address.hostname}::{address.port}::SOCKET", write_termination="\n", read_termination="\n"
    )
    meter = ThorlabsPM100(inst=resource)
    meter.configure.scalar.power()
    meter.sense.average.count = 10
    meter.sense.correction.wavelength = 632.8
    found = {
        "id": resource.query("*IDN?"),
        "sensor": meter.system.sensor.idn,
        "configured": meter.getconfigure,
        "average": meter.sense.average.count,
        "wavelength": meter.sense.correction.wavelength,
        "wavelengths": [meter.sense.correction.minimum_wavelength, meter.sense.correction.maximum_wavelength],
        "power": meter.read,
        "unit": meter.sense.power.dc.unit,
        "error": resource.query("SYST:ERR?"),
    }
    resource.write("NOTHING:LIKE:IT")
    found["error after nonsense"] = resource.query("SYST:ERR?")
    resource.close()
    return found


def read_lock_in(manager, port):
    lock_in = manager.open_resource(f"ASRL{port}::INSTR", baud_rate=9600, write_termination="\n", read_termination="\r")
    lock_in.write("OUTX 0")
    found = {"id": lock_in.query("*IDN?"), "both": []}
    lock_in.write("freq?;phas?")
    found["both"] = [float(lock_in.read()), float(lock_in.read())]
    found["snap"] = lock_in.query_ascii_values("SNAP? 3,4")
    lock_in.close()
    return found


def main(arms, lock_in, meter):
    manager = pyvisa.ResourceManager("@py")
    return {"arm": drive_arm(arms), "meter": read_meter(manager, meter), "lock-in": read_lock_in(manager, lock_in)}


if __name__ == "__main__":
    print(json.dumps(main(*sys.argv[1:])))
