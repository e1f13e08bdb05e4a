"""The data of a cell: names, points, frames, payloads, lists of motions; one file on the server for all pages.

contents    what may stand in the file: checks of every value, text to data and back
cell_store  the file: revisions, kept versions, writes that are whole or not at all
change_log  who has changed what, in a log that ``jaka_bag verify`` checks
"""
