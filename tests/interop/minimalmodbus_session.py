"""Drives a bench's Oriental Motor AZ and SMC LEC with MinimalModbus; run in the environment of requirements.txt.

Arguments: the serial ports of the AZ and, where there is one, of the LEC, both unit 1. Prints one JSON object.
"""

import json
import sys
import time

import minimalmodbus

DIRECT_DATA, DRIVER_INPUT, DRIVER_STATUS, FEEDBACK_POSITION = 0x0058, 0x007C, 0x007E, 0x00CC
MOVE, IN_POSITION = 1 << 13, 1 << 14
SVON, SETUP, SERIAL_MODE = 0x19, 0x1C, 0x30
BUSY, SVRE, SETON = 0x48, 0x49, 0x4A
LEC_POSITION, START, OPERATION = 0x9000, 0x9100, 0x9102
STEPS = 1500


def words(value):
    return [(value >> 16) & 0xFFFF, value & 0xFFFF]


def drive_az(port):
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


def drive_lec(port):
    controller = minimalmodbus.Instrument(port, 1)
    controller.serial.timeout = 2

    def wait_until(place, state):
        for _ in range(1000):
            if controller.read_bit(place, functioncode=2) == state:
                return
            time.sleep(0.01)
        raise TimeoutError(f"input {place:#x} has not become {state}")

    found = {}
    try:
        controller.write_register(OPERATION, 1, functioncode=6)
    except minimalmodbus.ModbusException as error:
        found["function 06"] = str(error)
    controller.write_bit(SERIAL_MODE, 1)
    controller.write_bit(SVON, 1)
    wait_until(SVRE, 1)
    controller.write_bit(SETUP, 1)
    wait_until(SETON, 1)
    controller.write_bits(SVON, [1, 0, 0, 0])
    controller.write_registers(
        OPERATION, [1, 60, *words(-4500), 300, 300, 0, 0, 0, 100, *words(0), *words(0), *words(10)]
    )
    controller.write_register(START, 0x0100)
    wait_until(BUSY, 0)
    return found | {
        "position": controller.read_long(LEC_POSITION, signed=True),
        "target": controller.read_long(LEC_POSITION + 4, signed=True),
        "start": controller.read_register(START),
        "coils": controller.read_bits(SVON, 4, functioncode=1),
        "inputs": controller.read_bits(BUSY, 8, functioncode=2),
    }


def main(az_port, lec_port=None):
    found = drive_az(az_port)
    return found | {"lec": drive_lec(lec_port)} if lec_port else found


if __name__ == "__main__":
    print(json.dumps(main(*sys.argv[1:])))
