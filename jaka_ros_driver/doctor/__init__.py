"""The command jaka_doctor: what a computer, a ROS graph and a controller lack for a driver, and what to do about it.

command        options, the table of all checks, the report as lines or JSON
findings       the result of a check: level, what was found, its meaning, the remedy
subject        the system that is examined: the driver's parameters, and what several checks look at once
computer       Python, packages, clock, folders, limits, the disk
graph          the ROS master, this computer's address as others see it, ROS time, the node's name
configuration  the driver's parameters, its folders, another driver on this computer
controller     the ports, the status feed, the controller's answers, the model against the arm
questions      the connections to a controller: only to listen, and to ask what the driver asks at its start
bundle         the file for a bug report

Nothing here moves, sets or powers anything at a controller. The checks need no running driver, and disturb none.
"""
