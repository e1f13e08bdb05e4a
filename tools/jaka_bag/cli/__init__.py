"""The program ``jaka_bag``.

commands     the table of subcommands, and those that other packages bring
main         finds the subcommand, runs it, turns errors into a line and an exit code
quantities   durations and sizes as users write them
progress     a progress bar with rate and time left
options      options that several subcommands share
notices      lines on standard error that nobody waits for
record, play                              the ROS graph
info, convert, filter, merge, split       logs
recover, export, plot, compare            logs
completion                                completion for bash or zsh
"""
