"""What takes several requests, one after the other, each on a condition: written as generators.

procedure   the steps of which procedures are made, and what drives them
session     what is asked of a controller when it is connected
power       power, enabling and alarms
recovery    all steps to an arm that can move, as one act
pausing     pause and resume, and the speed of it all
programs    load, pause and stop programs of the controller's own
settings    settings that are read back
"""
