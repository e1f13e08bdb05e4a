"""The process that plans the motion that a log shows (as ``jaka_bag replay-motion`` does) and prints it as JSON.

It is a process of its own because it computes for seconds: in the panel's process that would hold up heartbeats.
Arguments: the log and the factor of the recorded speed; standard input: the URDF of the arm that is to move.
"""
import json
import os
import sys
from typing import List

from jaka_bag.compare.runs.loading import load_run
from jaka_bag.errors import BagError, JakaBagError
from jaka_regression.motion.limits import LogParameters, limits_from_urdf, same_model
from jaka_regression.motion.plan import plan_motion
from jaka_regression.motion.recorded import recorded_joints

_NICE = 10
"""Niceness of planning, 0 to 19: the driver on the same computer goes first."""


def main(argv: List[str]) -> int:
    """Print the plan, or ``{"error": TEXT}``; 0 done, 1 refused."""
    os.nice(_NICE)
    try:
        recording = recorded_joints(load_run(argv[0], with_contents=False))
        limits = limits_from_urdf(sys.stdin.read(), recording.names)
        parameters = LogParameters(argv[0], recording.node)
        in_log = parameters.description
        model = limits_from_urdf(in_log, recording.names).model if in_log is not None else parameters.model
        if model is not None and not same_model(model, limits.model):
            raise BagError("it was recorded with a %s, and this arm is a %s" % (model, limits.model))
        plan = plan_motion(recording, limits, float(argv[1]))
    except (JakaBagError, OSError, ValueError) as error:
        print(json.dumps({"error": str(error)}))
        return 1
    notes = list(plan.notes)
    if model is None:
        notes.append("the log does not tell with which arm it was recorded")
    print(json.dumps({"time": plan.time.tolist(), "position": plan.position.tolist(),
                      "velocity": plan.velocity.tolist(), "acceleration": plan.acceleration.tolist(),
                      "warnings": notes}))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
