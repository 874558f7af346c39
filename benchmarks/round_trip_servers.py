"""What round_trips.py talks to, each server a process of its own on another processor than its client.

    round_trip_servers.py bench SCENE …    the devices of scenes, in virtual time
    round_trip_servers.py echo             sends back what it is sent
    round_trip_servers.py sinstruments     a sinstruments device that answers every line (in the peers' environment)

Each prints the addresses at which it is reached as one line of JSON, and serves until its input ends.
"""

import json
import os
import selectors
import socket
import sys
import tempfile
import threading
import tty
from contextlib import ExitStack

ANSWER = b"12.500000\r\n"


def announce(addresses):
    print(json.dumps(addresses), flush=True)
    sys.stdin.read()


def serve_bench(*scenes):
    import yaml

    from goniometer.bench import simulate
    from sim_devices.scene import Scene

    with ExitStack() as benches:
        addresses = {}
        for path in scenes:
            with open(path, encoding="utf-8") as file:  # noqa: PTH123 (nothing but the text is needed)
                scene = Scene.model_validate(yaml.safe_load(file))
            bench = benches.enter_context(simulate(scene, "max"))
            addresses |= {name: [address.tcp, address.pty] for name, address in bench.addresses.items()}
        announce(addresses)


def serve_echo():
    master, slave = os.openpty()
    tty.setraw(slave)
    listener = socket.create_server(("127.0.0.1", 0))

    def answer_terminal():
        while True:
            os.write(master, os.read(master, 4096))

    def answer_connections():
        with selectors.DefaultSelector() as selector:
            selector.register(listener, selectors.EVENT_READ)
            while True:
                for key, _ in selector.select():
                    if key.fileobj is listener:
                        connection, _ = listener.accept()
                        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                        selector.register(connection, selectors.EVENT_READ)
                    elif data := key.fileobj.recv(4096):
                        key.fileobj.sendall(data)
                    else:
                        selector.unregister(key.fileobj)
                        key.fileobj.close()

    for serve in (answer_terminal, answer_connections):
        threading.Thread(target=serve, daemon=True).start()
    announce({"echo": [f"socket://127.0.0.1:{listener.getsockname()[1]}", os.ttyname(slave)]})


def serve_sinstruments():
    from sinstruments.simulator import BaseDevice, Server

    class Position(BaseDevice):
        def handle_message(self, message):
            return ANSWER

    class Registered:
        def load(self):
            return Position

    with tempfile.TemporaryDirectory() as folder, socket.create_server(("127.0.0.1", 0)) as free:
        port, path = free.getsockname()[1], f"{folder}/pty"
        free.close()
        transports = [{"type": "tcp", "url": ["127.0.0.1", port]}, {"type": "serial", "url": path}]
        device = {"class": "Position", "name": "position", "transports": transports}
        server = Server(devices=[device], registry={"Position": Registered()})
        tty.setraw(server.devices["position"].transports[1].slave)
        print(json.dumps({"position": [f"socket://127.0.0.1:{port}", path]}), flush=True)
        server.serve_forever()


if __name__ == "__main__":
    kind, *arguments = sys.argv[1:]
    {"bench": serve_bench, "echo": serve_echo, "sinstruments": serve_sinstruments}[kind](*arguments)
