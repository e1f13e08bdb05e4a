"""Many runs against one golden log: how near each check was to its limit, and since when it moves there.

outcome    what is kept of one comparison: plain values, no samples
task       one run compared, as a task of an engine
rejudging  kept outcomes under other tolerances, without the logs
store      the outcomes as Parquet tables, and a journal while they come
trend      robust slopes with their uncertainty, and the point from which on values change
history    the runs of each cell in the order of time: series, trends, what drifts since when
page       all of it as one HTML page
junit      all of it as JUnit XML
summary    all of it as a few lines of text, and as plain data
"""
