"""The controller's TCP/JSON protocol as pure functions and small state machines: no sockets, threads or clocks.

texts          the controller's words, made fit for logs, messages and terminals
framing        cuts JSON objects out of byte streams
steady_arrays  the long arrays of numbers in these, parsed anew only when they change
codec          commands as request objects, replies as results or refusals
exchange       which reply answers which request
ports          names and numbers of the TCP ports
status         status frames of the feed, to and from robot states
"""
