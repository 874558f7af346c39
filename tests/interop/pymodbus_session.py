"""Drives a bench's Modbus drives with pymodbus; run in the environment of requirements.txt.

Arguments: the serial ports of an Oriental Motor AZ (unit 1) and of an SMC LEC (unit 1), and the URL of a Modbus TCP
gateway with another AZ (unit 1) and another LEC (unit 2) behind it. Prints one JSON object.
"""

import json
import sys
import time
from urllib.parse import urlsplit

from pymodbus.client import ModbusSerialClient, ModbusTcpClient

MOVE = 1 << 13


def words(*numbers):
    return [word for number in numbers for word in (number >> 16 & 0xFFFF, number & 0xFFFF)]


def number(reply):
    high, low = reply.registers
    return (high << 16 | low) - (high >> 15 << 32)


def wait_until(state):
    for _ in range(1000):
        if state():
            return
        time.sleep(0.005)
    raise TimeoutError("the drive has not come so far")


def drive_az(client, unit):
    def moves():
        return number(client.read_holding_registers(0x7E, count=2, device_id=unit)) & MOVE

    found = {"echo": client.diag_query_data(b"\x12\x34", device_id=unit).message.hex()}
    # number, type, position, speed, two rates, current, trigger
    operation = words(0, 1, -2500, 2000, 1_000_000, 1_000_000, 1000, 1)
    client.write_registers(0x58, operation, device_id=unit)
    wait_until(lambda: not moves())
    found["position"] = number(client.read_holding_registers(0xCC, count=2, device_id=unit))
    # relative to the command position, and read back, in one message
    reply = client.readwrite_registers(
        read_address=0x5C, read_count=2, write_address=0x58, values=words(0, 2, 500, 2000, *[1_000_000] * 2, 1000, 1),
        device_id=unit,
    )  # fmt: skip
    found["written and read"] = number(reply)
    wait_until(lambda: not moves())
    found["position after it"] = number(client.read_holding_registers(0xCC, count=2, device_id=unit))
    client.write_register(0x7D, 1 << 4, device_id=unit)
    client.write_register(0x7D, 0, device_id=unit)
    wait_until(lambda: not moves())
    found["home"] = number(client.read_holding_registers(0xCC, count=2, device_id=unit))
    refused = (
        client.read_coils(0, count=1, device_id=unit),
        client.read_holding_registers(0x59, count=1, device_id=unit),
        client.write_registers(0x5A, words(99), device_id=unit),
    )
    return found | {"exceptions": [reply.exception_code for reply in refused]}


def drive_lec(client, unit):
    def state(place):
        return client.read_discrete_inputs(place, count=1, device_id=unit).bits[0]

    client.write_coil(0x30, True, device_id=unit)
    client.write_coil(0x19, True, device_id=unit)
    wait_until(lambda: state(0x49))
    client.write_coil(0x1C, True, device_id=unit)
    wait_until(lambda: state(0x4A))
    client.write_coils(0x1A, [False, False, False], device_id=unit)
    operation = [1, 60, *words(-3000), 300, 300, 0, 0, 0, 100, *words(0, 0, 10)]
    client.write_registers(0x9102, operation, device_id=unit)
    client.write_registers(0x9100, [0x0100], device_id=unit)
    wait_until(lambda: not state(0x48) and not client.read_holding_registers(0x9100, device_id=unit).registers[0])
    return {
        "position": number(client.read_holding_registers(0x9000, count=2, device_id=unit)),
        "in position": state(0x4B),
        "function 06": client.write_register(0x9103, 30, device_id=unit).exception_code,
        "beyond": client.read_holding_registers(0x9120, count=1, device_id=unit).exception_code,
    }


def main(az_port, lec_port, gateway):
    found = {}
    with ModbusSerialClient(az_port, baudrate=115200, timeout=2) as client:
        found["az by rtu"] = drive_az(client, 1)
    with ModbusSerialClient(lec_port, baudrate=38400, timeout=2) as client:
        found["lec by rtu"] = drive_lec(client, 1)
    address = urlsplit(gateway)
    with ModbusTcpClient(address.hostname, port=address.port, timeout=2) as client:
        found |= {"az by tcp": drive_az(client, 1), "lec by tcp": drive_lec(client, 2)}
        found["nobody"] = client.read_holding_registers(0, count=1, device_id=9).exception_code
    return found


if __name__ == "__main__":
    print(json.dumps(main(*sys.argv[1:])))
