"""The bytes between a driver and a controller, real or simulated: recorded, and played again.

sockets       accept, receive, send, close: as the simulated controller, the proxy and the player do it
listeners     listening sockets that are closed and opened again under the same number
port_server   the loop that the proxy and the player share
program       priority, signals and the first line of output of these programs
log           the wire log: every byte in and out, with its time
proxy         stands between a driver and a real controller and writes a wire log
script        a wire log as what is to be sent, and when
player        plays a wire log to a driver
"""
