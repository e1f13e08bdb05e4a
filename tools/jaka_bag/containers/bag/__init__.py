"""ROS bags, version 2.0, and the reading of version 1.2.

records    the records, and the index that they make; without numpy
reader     the contents of chunks as batches of messages
writer     writes chunks and the index
recovery   recovery of a cut-off, unindexed or damaged bag
rosrecord  reads bags of version 1.2
"""
