"""The motion of an arm in a log, as a trajectory that repeats it.

The modules, from the ground up; a module imports only from those above it in this list:

limits      what the arm can do, from its URDF: of the running driver, of the log, or of a file
recorded    the joints of a log: which topic, which part, and what is wrong with it
path        noisy samples to a smooth path without standstill at its ends
time_law    the speed along the path: as recorded, and slower where the arm cannot
plan        the points of the trajectory, audited as the driver will read them
picture     a plan beside what was recorded, as a page or a picture
"""
