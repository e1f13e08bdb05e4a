"""The program ``jaka_bag``.

main         the table of subcommands; runs one, turns errors into a line and an exit code; the program jaka_foxglove
quantities   durations and sizes as users write them
options      options that several subcommands share, and how they say what they did
notices      what recorder and player say: lines that nobody waits for, an account as JSON
viewers      options of servers for Foxglove and Lichtblick, and how they run
record, play                              the ROS graph
foxglove, serve                           for viewers: the graph, logs
info, convert, filter, merge, split       logs
recover, export, plot, compare            logs
contents                                  what is in a log, piece by piece: cat, du, doctor, attach, extract
reference                                 docs/jaka_bag.md: all commands and options, beside those of other programs
completion                                completion for bash or zsh
fleet                                     what is done with many logs, here or on a cluster
evidence                                  what is about accidents: black box, report, verify
"""
