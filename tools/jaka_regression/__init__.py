"""The replay of recorded runs, to compare them with the golden one; on jaka_bag and jaka_ros_driver.

The modules, from the ground up; a module imports only from those above it in this list:

command_lines      the command lines of what a replay starts; all of them are declared there
attended           work done in a thread, so that somebody can end the wait for it
driver_inputs      the calls of a log, and the goals, trajectories and targets that drivers took
command_schedule   when each recorded call is made again: times and causes
command_player     makes the calls, in threads where they overlap
preconditions      what must be as it was in the log, so that its calls mean the same
uncaused_motions   motions in a log that no call began: a replay of calls cannot repeat them
ros_node           the start of a ROS node that goes on without a log file
driver_client      the live driver through rospy: raw services, joints, states
message_player     sends recorded messages to the live driver through rospy; goals until their result
scenario           what a golden log needs besides itself: arms, simulated controllers, the operator's doings
processes          processes started, watched and ended
log_beginning      what a log begins with, for the simulated controller in its replay
host_watch         how long the computer let processes wait meanwhile
stage              master, simulated or recorded controllers, drivers, recorder and calls, together
replay             a golden log happens again and is compared
update             a new log takes the golden one's place, where an unchanged run is the same
replay_commands    the subcommand ``jaka_bag replay-commands``
replay_wire        the subcommand ``jaka_bag replay-wire``
motion             what an arm did in a log, as a trajectory: path, limits, times
trajectory_client  the driver's action FollowJointTrajectory through actionlib
replay_motion      the subcommand ``jaka_bag replay-motion``
cell               the cell's own nodes beside a simulated controller: its world, its run, its comparison
pytest_plugin      golden logs as tests of pytest
rostest_command    a golden log as a rostest
"""
