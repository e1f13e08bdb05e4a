"""The command ``jaka_bag``.

main         the table of subcommands; runs one, turns errors into a line and an exit code; the command jaka_foxglove
quantities   durations and sizes as users write them
options      options that several subcommands share, and the output of their results
notices      the output of recorder and player: lines that nobody waits for, an account as JSON
record, play                              the ROS graph
info, convert, filter, merge, split       logs
recover, export, plot, compare            logs
cat, du, doctor, attach, extract          what is in a log, piece by piece
verify                                    was a signed log or an audit log changed?
completion                                completion for bash or zsh
"""
