"""The cell's own nodes, run against a simulated controller and compared with its golden log.

The modules, from the ground up; a module imports only from those above it in this list:

sightings    causes as they are seen: terminals change, the arm begins to move, a service has answered
history      the sightings of a log, and what the operator and the world did in it
world        the events of a golden log, each after its cause, and the scenario file that has them
live_watch   the process that watches a running graph for sightings
launch_file  the user's launch file: what may not be in it
stage        master, simulated controllers, drivers, recorder, the world and the user's launch file, together
run          the cell's nodes run once and are compared
"""
