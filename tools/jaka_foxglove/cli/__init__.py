"""The command lines of the servers.

live      the command ``jaka_foxglove``: the topics of a running system
serve     ``jaka_bag serve``: logs
viewers   options that both have, and how a server runs
"""
