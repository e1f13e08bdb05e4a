"""The ROS layer: the only room that imports rospy and the generated messages.

node          the program jaka_driver: puts everything below together
params        private parameters, checked, as one DriverConfig
convert       ROS requests to commands, results and states to ROS messages; no other file here changes units
services      the services: their table, their server, what each does with the arm, the record of every call
audit         what of all this is recorded in the audit log
topics        state topics, transforms, diagnostics, and the topics that take servo targets
trajectories  FollowJointTrajectory, and trajectories by topic
action_server    of actionlib, without a traceback at the node's end
other_messages   types of control_msgs and industrial_msgs, installed or made at start
frame_table   the tool and user frames that the controller has stored
model_check   whether the controller's pose agrees with the arm model
connections   how many connections this node serves, and which are closed when there are too many
driver_lock, single_name   one driver for each controller, one node for each name
start_checks  refuses to start where no client can reach the node, time stands still, or a topic is used twice
master_watch  registers again with a ROS master that was restarted
log_bridge    log records of the package to rosout, the screen and the node's log file
"""
