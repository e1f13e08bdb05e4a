"""Trajectories over ROS, by the names and types of ros_controllers' JointTrajectoryController and of ROS-Industrial.

controller_params   the yaml of a ros_control cell
messages            goals to trajectories and tolerances, states to messages
action              FollowJointTrajectory: goals one after the other, each with exactly one end
topics              trajectories by topic, the controller's state, the service stop_motion
query               where the joints are wanted at a time: the service query_state
controller_manager  the names of ros_control's controller manager beside the one controller
"""
