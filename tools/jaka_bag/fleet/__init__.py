"""Many logs: one task a log, done here or on a cluster; a data set of tables that other programs read.

tasks        what is done with one log, and where: the engine-neutral core
processes    engine: processes of this computer
dask_engine  engine: a Dask cluster
conversion   convert as such a task
adding       adding to the data set as such a task
log_facts    what a log tells of itself: cell, arm, versions, triggers, losses
runs         the data set's table of logs
store        where a data set lies: a folder, or what fsspec reaches; files that appear whole
query        questions in SQL, by DuckDB
comparing    compare with a golden log, over many runs
"""
