"""MCAP.

records    reads records, and the summary that they make; without numpy
reader     the contents of chunks as batches of messages
writer     makes records; writes chunks, attachments, metadata and the summary
pieces     a file as a row of records, for those who look at its bytes
recovery   the one walk over a file's records: for damaged files, and for whole ones without a summary
resync     the next whole record behind damage
active     the index of a file that is still being written
"""
