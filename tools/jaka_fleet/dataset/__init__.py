"""A data set of Parquet tables, made of many logs, that other software reads.

adding      adding a log to the data set, as a task of an engine
log_facts   the facts that a log has about itself: cell, arm, versions, triggers, losses
runs        the data set's table of logs
store       where a data set lies: a folder, or what fsspec reaches; files that appear whole
query       questions in SQL, by DuckDB
"""
