"""The mutants of the velocity jog: in its dead-man, its ramp, its motion, and its reading of messages.

``mutants.py`` puts them together with those of all other rooms.
"""
from typing import Tuple

from mutant import Mutant

DEAD_MAN = ("test/client/velocity_jog/test_dead_man.py",)
RAMP = ("test/client/velocity_jog/test_ramp.py",)
STORIES = ("test/client/core/test_velocity_jog_stories.py",)
TOPICS = ("test/ros/topics/test_jog_topics.py",)

OF_JOGS: Tuple[Mutant, ...] = (
    Mutant("a jog needs no rest first", "client/core/velocity_jog/dead_man.py",
           "            if not message.wish.is_zero:\n", "            if False:\n", DEAD_MAN),
    Mutant("a message counts for ever", "client/core/velocity_jog/dead_man.py",
           "if self.is_held and now > self._counts_until:", "if False:", DEAD_MAN),
    Mutant("a message counts from its arrival alone", "client/core/velocity_jog/dead_man.py",
           "message.received_at + FRESH_S - max(message.age, 0.0)", "message.received_at + FRESH_S", DEAD_MAN),
    Mutant("a message that has waited is fresh", "client/core/velocity_jog/dead_man.py",
           "        if now > _counts_until(message):\n", "        if message.age > FRESH_S:\n", DEAD_MAN),
    Mutant("a repeated stamp counts", "client/core/velocity_jog/dead_man.py",
           "message.stamp_ns <= self._stamp_ns:", "message.stamp_ns < self._stamp_ns:", DEAD_MAN),
    Mutant("a stamp in the future counts", "client/core/velocity_jog/dead_man.py",
           "        if message.age < -AHEAD_S:\n", "        if False:\n", DEAD_MAN),
    Mutant("two publishers are one", "client/core/velocity_jog/dead_man.py",
           "        if len(self._received) > 1:\n", "        if False:\n", DEAD_MAN),
    Mutant("what is not understood is overheard", "client/core/velocity_jog/dead_man.py",
           "            self._refuse(message.problem)", "            raise InvalidCommand(message.problem)", DEAD_MAN),
    Mutant("each hold is the same", "client/core/velocity_jog/dead_man.py",
           "            self.grip += 1\n", "", DEAD_MAN + STORIES),
    Mutant("a joint runs into its limit", "client/core/velocity_jog/ramp.py",
           "min(top, speed_to_stop_within(high - position))", "top", RAMP),
    Mutant("a joint's speed jumps", "client/core/velocity_jog/ramp.py",
           "min(max(min(max(aim, low), high), before - _STEP_CHANGE), before + _STEP_CHANGE)",
           "min(max(aim, low), high)", RAMP),
    Mutant("braking takes twice its time", "client/core/velocity_jog/ramp.py",
           "speed / max(1, math.ceil(", "0.5 * speed / max(1, math.ceil(", RAMP),
    Mutant("the tool frame is the base", "client/core/velocity_jog/ramp.py",
           "        if wish.frame is JogFrame.TOOL:\n", "        if False:\n", RAMP),
    Mutant("the tool turns about its flange", "client/core/velocity_jog/ramp.py",
           "velocity = joint_velocity(jacobian(self._model, self.position, self._flange_t_tool), self._twist)",
           "velocity = joint_velocity(jacobian(self._model, self.position), self._twist)", RAMP),
    Mutant("a jog has any speed", "client/core/velocity_jog/ramp.py",
           "    if speed > limit * (1.0 + FLOAT32_SLACK):\n", "    if False:\n", RAMP),
    Mutant("a jog goes on when it is let go", "client/core/velocity_jog/motion.py",
           "            return ServoJoint(self._ramp.step(None))",
           "            return ServoJoint(self._ramp.step(wish))", STORIES),
    Mutant("a jog does not notice a new hold", "client/core/velocity_jog/motion.py",
           "or wish is None or self._dead_man.grip != self._grip:", "or wish is None:", STORIES),
    Mutant("a jog keeps the arm for ever", "client/core/velocity_jog/motion.py",
           "elif now - self._idle_since >= _IDLE_S:", "elif False:", STORIES),
    Mutant("an arm that does not follow is jogged on", "client/core/velocity_jog/motion.py",
           "        if excess <= MAX_JOINT_DEVIATION:\n", "        if True:\n", STORIES),
    Mutant("the speed override does not slow a jog", "client/core/velocity_jog/motion.py",
           "return 1.0 if rate is None else min(max(rate, 0.0), 1.0)", "return 1.0", STORIES),
    Mutant("a jog that was refused begins later by itself", "client/core/arm_core.py",
           "            self.dead_man.release(str(error))\n            raise\n", "            raise\n", STORIES),
    Mutant("a stop leaves the hold", "client/core/arm_core.py",
           "        self.last_disturbance = what\n        self.dead_man.release(what)\n",
           "        self.last_disturbance = what\n", STORIES),
    Mutant("joints are jogged in the order of the message", "ros/topics/jog_topics.py",
           "        velocity[number] = value\n", "        velocity[len(seen) - 1] = value\n", TOPICS),
    Mutant("a joint may be jogged twice", "ros/topics/jog_topics.py",
           "if number is None or number in seen:", "if number is None:", TOPICS),
    Mutant("any frame is the base", "ros/topics/jog_topics.py",
           "    if frame_id in (_BASE, names.base):\n", "    if True:\n", TOPICS),
    Mutant("a velocity that is no number is jogged", "ros/topics/jog_topics.py",
           "    if not all(map(math.isfinite, values)):\n", "    if False:\n", TOPICS),
    Mutant("the core does not hear of what is not understood", "ros/topics/jog_topics.py",
           "                    read = read._replace(problem=str(error))\n", "                    raise\n", TOPICS),
    Mutant("an age is counted backwards", "ros/topics/jog_topics.py",
           "(now - stamp).to_sec()", "(stamp - now).to_sec()", TOPICS),
)
