"""The driver's side of the controller's ports: sockets, threads and the rules of motion, without ROS."""
