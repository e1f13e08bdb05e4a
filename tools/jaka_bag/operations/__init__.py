"""The operations on whole logs.

columns     the messages of a log as numpy columns
convert     one file into another, as a job; and the functions that the next three share with it
merge       several logs into one
split       one log into several
recover     a damaged log into a whole one
timing      rate, jitter and gaps of messages
usage       the bytes of each topic
diagnosis   is a log whole, and if not, why not
extras      attachments and metadata: added, taken out
audit_log   follows the chain of the driver's audit log
signature   finds and names changed bytes in a signed log
export      fields as CSV, NPZ or Parquet
parquet     tables of messages as Parquet
plot        pictures of a log
thinning    fewer points that show the same curve
quantiles   quantiles of any number of values in bounded memory
tool_poses  positions and orientations of the tool, of each type that drivers publish
"""
