"""The ROS layer: the only room that imports rospy and the generated messages.

node          the command jaka_driver: creates and connects everything below
params        private parameters, checked, as one DriverConfig
gripper       a gripper on digital outputs: its description, and the decisions on goals, without ROS
convert       ROS requests to commands, results and states to ROS messages; no other file here changes units
services      the services: their table, their server, their handlers, the record of every call
audit         the lines of the audit log that are made from calls, goals and messages
topics        state topics, transforms, diagnostics, and the topics that take servo targets
trajectories  FollowJointTrajectory, and trajectories by topic
action_server    of actionlib, without a traceback at the node's end
errands       one thread for what waits for nothing: events, lines for /rosout, status and diagnostics
jaka_types    the service types of the installed jaka_msgs, and which it lacks
other_messages   types of control_msgs and industrial_msgs, installed or made at start
frame_table   the tool and user frames that the controller has stored, its load and collision level
metrics       the page for Prometheus, where a port is given for it
model_check   comparison of the controller's pose with the arm model
direct_publisher   publishers that write to their listeners in the publishing thread
packed        messages of the state topics as bytes, by the layout of their type
connections   bounds of the node's connections, and which are closed when there are too many
driver_lock, single_name   one driver for each controller, one node for each name
short_calls   calls of masters and nodes that end in time
start_checks  refuses to start where no client can reach the node, time stands still, or a topic is used twice
controller_profile   what a report of jaka_probe tells of the controller
exit_codes    what a supervisor learns of a driver that has ended
master_watch  registers again with a ROS master that was restarted
log_bridge    log records of the package to rosout, the screen and the node's log file
"""
