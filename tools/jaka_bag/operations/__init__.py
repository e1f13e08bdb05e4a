"""What is done with whole logs.

columns   the messages of a log as numpy columns
copying   messages of logs into another log, chunk by chunk
convert   one file into another, as a job for this process, others, or a Dask cluster
merge     several logs into one
split     one log into several
recover   a damaged log into a whole one
timing    how regularly messages came
export    fields as CSV, NPZ or Parquet
plot      pictures of a log
"""
