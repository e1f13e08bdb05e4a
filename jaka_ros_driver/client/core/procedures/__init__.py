"""Procedures: sequences of several requests, each on a condition, written as generators.

steps       the steps of procedures, and their driver
session     the questions to a controller that was connected
power       power, enabling and alarms
recovery    all steps to an arm that can move, as one act
pausing     pause and resume, and the speed override
programs    load, pause and stop programs of the controller's own
settings    settings that are read back
zones       the zones that the motion guard keeps
"""
