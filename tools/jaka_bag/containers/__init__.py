"""The container formats of logs.

index         the index at a log's end: connections, chunks, totals; without numpy
compression   the codecs of all formats
cut_blocks    the blocks of a compressed chunk that is cut off
interface     what every format offers: a reader and a writer, chunks as batches of messages, flat memory
recovery      what reads a damaged log, and what it yields
bag           ROS bags, version 2.0
mcap          MCAP
rosbag2_recovery   what reads a damaged rosbag2 folder
sqlite_records    the sqlite3 storage of rosbag2: topics, and where the messages are; without numpy
sqlite_reader     a database of it without its folder, behind the interface
sqlite_recovery   what reads a damaged one
packed_messages   messages that rosbag2 compressed one by one
rosbag2       rosbag2 folders (MCAP with CDR messages), written
rosbag2_declarations   what the metadata.yaml of a rosbag2 folder tells of its files
rosbag2_folder   rosbag2 folders, read by the library rosbags
rosbag2_reader   the same behind the interface
ros1_view     a log of other encodings as one of ROS 1
registry      the formats by content and by suffix: opens, creates, recovers
time_order    the messages of logs in the order of time
"""
