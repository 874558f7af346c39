"""Runs the command again and again, each time in a process of its own, forked from this one, which has loaded it all.

Started with the number of a socket and with arguments, for a first run in this very process that loads and compiles
whatever the command needs. Then each message on the socket holds a run's arguments, with the ends of its standard
output and error; the answer is the number of its process, which stays its own, also when it has ended, until a second
message asks for its exit code.
"""

import json
import os
import signal
import socket
import sys
import threading
from contextlib import suppress

from goniometer.cli import main


def begin(arguments, streams):
    """Run the command as the process of its own that it is; it ends with SystemExit."""
    for number, stream in enumerate(streams, start=1):
        os.dup2(stream, number)
        os.close(stream)
    sys.argv[1:] = arguments
    main()


def serve(orders):
    while True:
        arguments, streams, _, _ = socket.recv_fds(orders, 1 << 16, 2)
        if not arguments:
            return
        assert threading.active_count() == 1
        process = os.fork()
        if process == 0:
            orders.close()
            begin(json.loads(arguments), streams)
        for stream in streams:
            os.close(stream)
        orders.sendall(b"%d" % process)
        if not orders.recv(1):
            os.kill(process, signal.SIGKILL)  # nobody is there any more
            return
        orders.sendall(b"%d" % os.waitstatus_to_exitcode(os.waitpid(process, 0)[1]))


number, *sys.argv[1:] = sys.argv[1:]
with suppress(SystemExit):
    main()
serve(socket.socket(fileno=int(number)))
