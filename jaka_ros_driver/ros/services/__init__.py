"""The services of the node: from a ROS request to its response.

service_table     every service: its type, how its request is decoded, which handler serves it, how it is answered
service_handlers  what each service does with the arm
service_server    rospy's service, for clients built with other definitions too; calls are counted
recover_action    the action ~recover
path_action       the action ~move_path
servo_move_wire   the maker's own definition of ServoMove.srv
call_publisher    publishes a record of every call
"""
