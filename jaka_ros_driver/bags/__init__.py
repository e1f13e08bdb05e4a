"""State logs: read, write, record, play, convert, inspect and compare ROS 1 ``.bag`` and ``.mcap`` files.

The shelf, from the ground up; a module imports only from those above it in this list:

errors, output_file      what can go wrong with a log; outputs that appear only when whole
definitions              connections, ``.msg`` definitions, md5
compression              the codecs of both formats
blocks                   many messages in few numpy arrays: what readers give and writers take
bag_format, mcap_format  the records of the two containers, without numpy
bag_reader, mcap_reader  chunks to blocks, fast where regular, exact where not
bag_writer, mcap_writer  blocks or single messages to files with flat memory
readers, writers         either format: by content, by suffix

Beside it, what talks to a ROS graph; none of it needs ROS to be installed but ``rospy_transport``, if asked for:

ros_names, ros_graph             names of the graph; master and slave API over XMLRPC
tcpros, raw_transport            subscribing, with the kernel's times of receipt
bus_statistics, stream_account   what publishers say they sent, what came, what was lost
log_files, recorder, recording   files cut by age, split, finished when the disk is full; one recording
tcpros_publisher                 publishing without losing anything
log_source, player, keyboard     logs read ahead; messages sent at their times
"""
