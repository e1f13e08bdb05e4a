"""The command jaka_probe: what the first minutes beside a real controller settle of what documents leave open.

facts               what can be settled, what each means, and which dimension of the simulated controller it sets
recorded            connections whose every byte is kept for the wire log
look                the stage that sends nothing: the status feed
ask                 the stage that reads values on the command port; ``QUESTIONS`` and ``ask.ODD`` are all that it sends
report              the report as text and as JSON, two of them compared
program             options, the order of the stages, files

Neither stage sets, moves or powers anything.
"""
