"""The program ``jaka_bag``.

main         the table of subcommands; runs one, turns errors into a line and an exit code
quantities   durations and sizes as users write them
options      options that several subcommands share, and how they say what they did
notices      what recorder and player say: lines that nobody waits for, an account as JSON
record, play                              the ROS graph
info, convert, filter, merge, split       logs
recover, export, plot, compare            logs
contents                                  what is in a log, piece by piece: cat, du, doctor, attach, extract
reference                                 docs/jaka_bag.md: all commands and options, beside those of other programs
completion                                completion for bash or zsh
evidence                                  what is about accidents: black box, report, verify
"""
