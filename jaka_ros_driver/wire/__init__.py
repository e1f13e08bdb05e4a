"""The bytes between a driver and a controller, real or simulated: recorded, and played again.

listeners     listening sockets that are closed and opened again under the same number
priority      a process that is served before others
log           the wire log: every byte in and out, with its time
proxy         stands between a driver and a real controller and writes a wire log
script        a wire log as what is to be sent, and when
player        plays a wire log to a driver
"""
