"""The ROS layer: the only room that imports rospy and the generated messages.

params        private parameters, checked, as one DriverConfig
convert       ROS requests to commands, results and states to ROS messages; the only units changed here
operations    what each service does with the arm
services      the table of services and how a call becomes a reply and its evidence
publishers    state topics and transforms
diagnostics   the arm's and the link's condition, once a second
node          puts them together: the program jaka_driver
"""
