"""The simulated controller: a command (``jaka_sim``) and, as ``SimulatedController``, a part of other code.

The rooms, from the ground up; a room imports only from those above it in this list:

arm                   joints over time: profiles, paths, jog, servo mode, limits; no requests, no sockets
dialect               the open points on which real controllers may differ, each with its values
controller            power, errors, frames, inputs and outputs, and the commands that change them; no sockets
server                ports, clients, wire faults, the clock of the cycle, the operator port
simulated_controller  all of it in one object
__main__              the command line
"""
