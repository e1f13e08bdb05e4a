"""ROS bags, version 2.0.

records    the records, to and from bytes; without numpy and files
index      the index section: connections and chunk infos; without numpy
chunk      the contents of a chunk as a batch of messages
reader     reads the chunks of an indexed bag
writer     writes chunks and the index
recovery   reads a cut-off, unindexed or damaged bag as far as that goes
"""
