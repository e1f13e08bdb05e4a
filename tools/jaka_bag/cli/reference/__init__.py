"""The page of all commands and options, ``docs/jaka_bag.md``, made from the parsers.

page    writes it: build/venv/bin/python3 -m jaka_bag.cli.reference.page > docs/jaka_bag.md
peers   what rosbag, mcap and ros2 bag call the same
"""
