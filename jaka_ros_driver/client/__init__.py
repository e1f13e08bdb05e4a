"""The client of a controller, without ROS: its sockets and threads, and custody of the arm."""
