"""Drives a bench's Oriental Motor AZ with MinimalModbus; run in the environment of requirements.txt.

Argument: the serial port of the drive. Prints one JSON object.
"""

import json
import sys
import time

import minimalmodbus

DIRECT_DATA, DRIVER_INPUT, DRIVER_STATUS, FEEDBACK_POSITION = 0x0058, 0x007C, 0x007E, 0x00CC
MOVE, IN_POSITION = 1 << 13, 1 << 14
STEPS = 1500


def words(value):
    return [(value >> 16) & 0xFFFF, value & 0xFFFF]


def main(port):
    drive = minimalmodbus.Instrument(port, 1)
    drive.serial.timeout = 2

    def status():
        return drive.read_long(DRIVER_STATUS)

    operation = [0, 1, STEPS, 2000, 1_000_000, 1_000_000, 1000, 1]
    drive.write_registers(DIRECT_DATA, [word for value in operation for word in words(value)])
    moved = bool(status() & MOVE)
    for _ in range(1000):
        if not status() & MOVE:
            break
        time.sleep(0.01)
    found = {
        "moved": moved,
        "in position": bool(status() & IN_POSITION),
        "position": drive.read_long(FEEDBACK_POSITION, signed=True),
    }
    try:
        drive.read_register(0x0001)
    except minimalmodbus.ModbusException as error:
        found["odd address"] = type(error).__name__
    try:
        drive.read_bit(0)
    except minimalmodbus.ModbusException as error:
        found["unsupported function"] = str(error)
    drive.write_register(DRIVER_INPUT + 1, 1 << 4, functioncode=6)
    drive.write_register(DRIVER_INPUT + 1, 0, functioncode=6)
    for _ in range(1000):
        if not status() & MOVE:
            break
        time.sleep(0.01)
    found["position after ZHOME"] = drive.read_long(FEEDBACK_POSITION, signed=True)
    return found


if __name__ == "__main__":
    print(json.dumps(main(sys.argv[1])))
