"""ROS 1 driver for JAKA six-axis arms, and its simulated controller.

The rooms, from the ground up; a room imports only from those above it in this list:

errors, units       what can go wrong; mm and deg to SI
yaml_text           YAML of files that people write: no key twice
scheduling          what the operating system is asked for, so that threads wake in time
background_log      log records and lines on standard error, written in a thread of their own
state, commands     one sample of the arm; what an arm can be asked to do (SI units, frozen)
kinematics          arm models, forward and inverse kinematics, the limits audit
protocol            the controller's JSON protocol: bytes <-> state and commands, no I/O
trajectory          joint trajectories: audited paths, and the clock that runs along them
clearance           how near the arm comes to itself and to zones around it
client              custody of the arm, its sockets and threads; without ROS
wire                the bytes between driver and controller: recorded and played
audit               the audit log: who did what, as chained lines in files
simulation          the simulated controller
ros                 the node: parameters, services, topics, diagnostics
doctor              the command jaka_doctor: what a computer lacks for a driver
probe               the command jaka_probe: what a real controller settles of what documents leave open

Beside it, in tools/: the log tools ``jaka_bag``, ``jaka_blackbox``, ``jaka_foxglove`` and ``jaka_fleet``, which import
nothing of this package; ``jaka_panel``, an operator's page, a client of its topics and services;
``jaka_regression``, on top of the driver and the log tools, which makes recorded runs happen again; and
``jaka_migration``, commands for cells that move here from the maker's packages.
"""

__version__ = "0.3.0"
