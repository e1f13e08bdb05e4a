"""The command jaka_probe: what the first minutes beside a real controller settle of what documents leave open.

facts               what can be settled, what each means, and which dimension of the simulated controller it sets
recorded            connections whose every byte is kept for the wire log
fields              types and ranges of the fields of frames and replies, and which of them is a clock
look                the stage that sends nothing: the status feed
ask                 the stage that reads values on the command port; ``QUESTIONS`` and ``ask.ODD`` are all that it sends
set_same            the stage that sets values to what they are; ``SETTINGS`` and ``READ_BACK`` are all that it sends
move                the stage that moves one joint a little; ``MOVES`` is all that it sends, besides what stops the arm
moving              what its steps have in common
servo_steps, pendant_steps   its steps that stream, and those for which a person does something at the pendant
motion              the arm while it moves: its room, custody, the guard process
fit, twin           how the arm accelerates, and how far the simulated one that is made of the report is from it
person              questions to whoever is at the terminal
statements          what docs/controller-protocol.md says, and whether the facts confirm it
identity            what names an arm, a computer or a person in a report
page                the report as a page for a browser
report              the report as text and as JSON, two of them compared
command             options, the order of the stages, files

Nothing is powered. look and ask set nothing, set moves nothing.
"""
