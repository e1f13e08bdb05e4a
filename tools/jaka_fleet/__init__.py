"""Many logs: a data set of tables that other software reads, many runs against a golden one, replays of many goldens.

On top of ``jaka_bag``, whose engines do the work on one log after the other, here or on a cluster; ``replay`` needs
``jaka_regression`` besides.

dataset     a data set of Parquet tables: logs added to it, questions in SQL
comparing   many runs against one golden log
replay      many golden logs replayed side by side
cli         the command lines
"""
