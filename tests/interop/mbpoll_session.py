"""Drives a bench's Modbus drives with Debian's mbpoll, which must be on the path.

Arguments: the serial ports of an Oriental Motor AZ (unit 1) and of an SMC LEC (unit 1), and the URL of a Modbus TCP
gateway with another AZ (unit 1) and another LEC (unit 2) behind it. Prints one JSON object.
"""

import json
import re
import subprocess
import sys
import time
from urllib.parse import urlsplit

VALUE = re.compile(r"\[(\d+)\]:\s+(-?\w+)")
ON, OFF = 1, 0
SVON, SETUP, SERIAL_MODE = 0x19, 0x1C, 0x30
BUSY, SVRE, SETON = 0x48, 0x49, 0x4A


def rtu(port, unit):
    return ["-m", "rtu", "-b", "115200", "-P", "none", "-a", str(unit)], port


def tcp(url, unit):
    address = urlsplit(url)
    return ["-m", "tcp", "-p", str(address.port), "-a", str(unit)], address.hostname


def poll(device, kind, address, *, count=1, values=()):
    """Ask mbpoll once; the numbers that it prints, or its complaint."""
    link, port = device
    command = ["mbpoll", *link, "-0", "-1", "-B", "-o", "2", "-t", kind, "-r", str(address)]
    if not values:
        command += ["-c", str(count)]
    command += [port, "--", *map(str, values)] if values else [port]
    done = subprocess.run(command, capture_output=True, text=True, timeout=20, check=False)
    if done.returncode or "failed" in done.stderr:
        return (done.stdout + done.stderr).strip().splitlines()[-1]
    return [int(value, 0) for _, value in VALUE.findall(done.stdout)]


def wait_until(device, address, state):
    for _ in range(200):
        if poll(device, "1", address) == [state]:
            return
        time.sleep(0.02)
    raise TimeoutError(f"input {address:#x} has not become {state}")


def drive_az(device):
    # number, type, position, speed, two rates, current, trigger, each of 32 bits
    poll(device, "4:int", 0x58, values=(0, 1, -1500, 2000, 1_000_000, 1_000_000, 1000, 1))
    for _ in range(200):
        if not poll(device, "4:int", 0x7E)[0] & 1 << 13:
            break
        time.sleep(0.02)
    return {
        "position": poll(device, "4:int", 0xCC),
        "single register": poll(device, "4", 0x1803, values=(7,)),
        "stored position": poll(device, "4:int", 0x1802),
        "several items": poll(device, "4:int", 0x5C, count=2),
        "odd address": poll(device, "4", 0x59),
        "coils": poll(device, "0", 0),
        "input registers": poll(device, "3", 0xCC, count=2),
    }


def drive_lec(device):
    # position, speed, thrust, target and step, and what follows them, before anything has moved
    found = {"state": poll(device, "4", 0x9000, count=16), "single register": poll(device, "4", 0x9103, values=(30,))}
    poll(device, "0", SERIAL_MODE, values=(ON,))
    poll(device, "0", SVON, values=(ON,))
    wait_until(device, SVRE, ON)
    poll(device, "0", SETUP, values=(ON,))
    wait_until(device, SETON, ON)
    poll(device, "0", SETUP - 1, values=(OFF, OFF, OFF))
    # absolute, 60 deg/s to 45 deg, 300 deg/s² both ways, no push, in position to 0.10 deg
    poll(device, "4", 0x9102, values=(1, 60, 0, 4500, 300, 300, 0, 0, 0, 100, 0, 0, 0, 0, 0, 10))
    poll(device, "4", 0x9100, values=(0x0100, 0))
    wait_until(device, BUSY, OFF)
    return found | {
        "start": poll(device, "4", 0x9100, count=2),
        "position": poll(device, "4:int", 0x9000),
        "coils": poll(device, "0", SVON, count=4),
        "inputs": poll(device, "1", 0x40, count=16),
        "beyond the coils": poll(device, "0", 0x40),
    }


def main(az_port, lec_port, gateway):
    return {
        "az by rtu": drive_az(rtu(az_port, 1)),
        "lec by rtu": drive_lec(rtu(lec_port, 1)),
        "az by tcp": drive_az(tcp(gateway, 1)),
        "lec by tcp": drive_lec(tcp(gateway, 2)),
        "nobody": poll(tcp(gateway, 9), "4", 0x9000),
    }


if __name__ == "__main__":
    print(json.dumps(main(*sys.argv[1:])))
