"""The command lines about many logs.

comparing            compare many runs with one golden log
engine               where the tasks are done, and how far they are
add, query, compact  the commands of ``jaka_bag dataset``
"""
