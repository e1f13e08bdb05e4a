"""The services of the node: from a ROS request to its response.

table             every service: its type, decoder, handler and response
handlers          the handlers, which carry services out with the arm
server            rospy's service, for clients built with other definitions too; calls are counted
connection        one client's connection: requests in, answers out, without waiting for the client
loop              serves all connections with a few threads; stops have threads of their own
recover_action    the action ~recover
path_action       the action ~move_path
gripper_action    the action of a gripper, and its joint
wire_definitions  further definitions of ServoMove and ClearErr, for clients that were built with them
call_publisher    the publisher of a record of every call
"""
