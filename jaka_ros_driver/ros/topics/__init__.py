"""The topics of the node.

state_publishers  state topics and transforms, for every status frame
state_repeater    repeats samples where the status feed is slower than the wanted rate, leaves some out where faster
stamps, velocity  ROS time of a sample; joint velocity where the controller does not report it
speed             the speed override
io_states         inputs and outputs
sensors           force sensor, temperatures and currents of the joints, where the feed has them
motion_ends       the ends of accepted moves and programs
robot_status      the status message of ROS-Industrial
servo_topics      servo targets by topic
jog_topics        velocity jog by topic
workspace_markers  zones and capsules of the motion guard, for rviz
diagnostic_states  the meaning and the remedy of each state that the diagnostics show
diagnostics       condition of arm and link, once a second
"""
