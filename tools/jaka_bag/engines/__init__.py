"""One task a log, done here, in processes of this computer or on a Dask cluster.

tasks        what is done with one log, and where: knows none of the others
processes    an engine: processes of this computer
dask_engine  an engine: a Dask cluster
conversion   converting a file, as such a task
"""
