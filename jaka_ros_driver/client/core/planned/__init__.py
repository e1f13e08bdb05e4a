"""Motions that the controller plans as a whole.

path_audit  the audit of a path before anything of it is sent
path_move   a path of several segments, as one queue
program     a program that is stored in the controller
"""
