"""The controller's TCP/JSON protocol as pure functions and small state machines: no sockets, threads or clocks."""
