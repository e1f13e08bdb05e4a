"""The command lines about many logs.

engine               where the tasks are done, and how far they are
add, query, compact  the commands of ``jaka_bag dataset``
comparing            ``jaka_bag compare --against``: many runs with one golden log
replay               ``jaka_bag replay``: many golden logs against a driver
"""
