"""The command lines about many logs.

engine               where the tasks are done, and how far they are
add, query, compact  the commands of ``jaka_bag dataset``
compare              ``jaka_bag compare``: one run with a golden log, or many
replay               ``jaka_bag replay``: many golden logs against a driver
"""
