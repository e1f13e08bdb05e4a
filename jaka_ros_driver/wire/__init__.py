"""The bytes between a driver and a controller, real or simulated: recorded, and replayed.

sockets           non-blocking accept, receive, send and close, shared by simulated controller, proxy and replayer
listeners         listening sockets that are closed and opened again under the same number
port_server       the loop that the proxy and the replayer share
startup           priority, signals and the first line of output of these commands
log               the wire log: every byte in and out, with its time
proxy             stands between a driver and a real controller and writes a wire log
recorded_session  a recorded session: the bytes of a wire log, arranged for replay
replayer          replays a recorded session to a driver
"""
