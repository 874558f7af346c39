"""How the bench meets its clients: a clock, one reactor, ports, shared lines, and the control socket."""
