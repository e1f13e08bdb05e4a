"""Messages as bytes: their description in a log, and many of them at once in numpy arrays.

connection    what a log knows about one publisher's stream
definitions   ROS 1 message definitions: text to fields, and the md5 of a type
batch         many messages in one buffer: what readers give, filters pick from and writers take
selection     which messages are wanted: topics, types, times
layout        where the fields of serialised messages lie; messages of one layout are handled together
values        one message as Python values
value_writer  values as one message
decoding      single messages as data for JSON
columns       fields of messages as numpy columns
encodings     messages of other encodings (CDR, JSON, Protobuf) in the form of ROS 1
json_types    JSON messages as those of ROS 1, by their JSON Schema
protobuf_types  Protobuf messages as those of ROS 1, by their descriptors
ros2_types    ROS 2 definitions, type hashes and single CDR messages, by the library rosbags
cdr           ROS 1 messages to CDR, many at once
table_names   names of topics for files, members of archives and views, no two of which meet
"""
