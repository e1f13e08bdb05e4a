"""The simulated controller without its sockets: a request in, a reply out, status frames at any time.

executor                               carries out one request
command_spec, command_table            what a command is; the table of all commands
commands_frames, commands_io, commands_motion, commands_program, commands_settings, commands_system  their groups
state                                  power, stops, errors and programs: the state that commands change
beginning                              what a controller begins with, as a file tells it
alarms, io_banks, memory, firmware     which error is shown, inputs and outputs, what survives a restart, generations
force_sensor                           the sensor at the flange
arguments, replies, wire_units         parameters of a request, replies, units and decimals of the wire
status_frame                           the frames of the status feed and of the polled port
"""
