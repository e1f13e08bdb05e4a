"""The ROS graph without ROS: what records from it and plays into it.

names             names of the graph: resolving, remapping, node names, this host's address
graph             calls to the master and to other nodes, and the server they call back
tcpros            connection headers, and a link to one publisher
publisher         publishes without losing anything
stream_account    messages of each publisher received, written and lost
bus_statistics    messages that publishers report as sent to us
topic_selection   which topics a recording takes
subscriber        one loop over all publishers' links, with the kernel's times of receipt
rolling_files     the files that a recording writes: cut by age, split, finished when the disk is full
writer_thread     a bounded buffer between the receiving thread and the writing one
session           one recording from start to end
log_source        the messages of logs read ahead, framed for the wire
latency_histogram  how late messages were sent, in logarithmic bins
keyboard          single keys from a terminal
player            sends messages at their times
linux_timing      makes the calling thread wake up on time
"""
