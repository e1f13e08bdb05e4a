"""What is in a log, piece by piece: the commands that the ``mcap`` program is known for.

cat               messages as lines of JSON
du                bytes of each topic
doctor            is a log whole, and why not
attach, extract   files and facts beside the messages
"""
