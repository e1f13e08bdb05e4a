"""MCAP (specification, version 0).

records    the records, to and from bytes; without numpy and files
chunk      the contents of a chunk as a batch of messages
reader     reads chunks, attachments and metadata
walk       the index of a file that has no usable summary, from a walk over its records
index      the index of a file, from its summary; without numpy where there is one
writer     writes chunks, attachments, metadata and the summary
recovery   reads a cut-off or damaged file as far as that goes
"""
