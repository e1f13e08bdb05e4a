"""What is done with whole logs.

columns   the messages of a log as numpy columns
convert   one file into another, as a job; and what the next three share with that
many      many such jobs at a time, in processes or on a Dask cluster
merge     several logs into one
split     one log into several
recover   a damaged log into a whole one
timing    how regularly messages came
export    fields as CSV, NPZ or Parquet
plot      pictures of a log
tool_poses  positions and orientations of the tool, of each type that drivers publish
"""
