"""The client of a controller, without ROS: its sockets and threads, and custody of the arm.

core            custody of the arm, as pure state machines
settings        address, time limits and bounds of one client; the numbers that a user may change
transport       the two connections to the controller, and one wait for both; the driver's and the guard's
arm_client      one arm for any number of threads: a lock around the core, one thread for its sockets and its time
followed_path   the path that is followed for a trajectory, and where it joins a running one
stop_timer      how long the stops of callers take
loop_task       the base class of periodic tasks in the client's thread
supervisor      signs of life for the supervisor of a service
fail_stop       the last stop and the evidence of a driver whose core has failed
runtime_file    small private files about a controller, for the next driver or guard
first_start     the note that a controller had a driver since the computer was switched on
custody_file    the motion in custody, on disk while it lasts
process_state   the state of another process, from the kernel
driver_pipe     the guard's end of the pipes between it and the driver
stopping        the guard's stop of an arm, step by step; without socket, thread and clock
arm_stopper     the sockets of the guard's stop
guard_process   the guard's process: stops the arm when the driver dies or freezes
guard_post      one guard process as the driver sees it
guard           the driver's end of the guard
"""
