"""Motions that the controller plans as a whole.

program   a program that is stored in the controller
"""
