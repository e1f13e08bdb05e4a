"""Makes a recorded run happen again, so that it can be compared with the golden one.

The shelf, from the ground up; a module imports only from those above it in this list:

command_schedule   when each recorded call is made again: times and causes
command_player     makes the calls, in threads where they overlap
driver_client      the live driver through rospy: raw services, joints, states
scenario           what a golden log needs besides itself: arms, simulated controllers, the operator's doings
processes          programs started, watched and ended
host_watch         how long the computer let programs wait meanwhile
replay             simulated controllers, master, driver, recorder and calls together; then the comparison
"""
