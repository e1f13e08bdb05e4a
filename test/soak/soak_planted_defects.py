"""Defects planted into a cell's node, the driver and the simulated controller: does a comparison find each?

    build/venv/bin/python3 test/soak/soak_planted_defects.py [--only WORDS] [--unchanged N]        in the devel space

The cell's node (``planted/every_way.py``) is recorded once; then it runs with each defect, one at a time, against
its golden log with default tolerances. First it runs unchanged, N times. Prints a line for each run, and which defects
were missed; exit code 1 when one was missed that has no reason here, or an unchanged run differed.
"""
import argparse
import os
import shutil
import sys
import tempfile
import time
from pathlib import Path
from typing import Dict, NamedTuple, Optional, Sequence, Tuple

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tools")]

from jaka_regression import command_lines  # noqa: E402 - the checkout, wherever it is started from
from jaka_regression.cell.run import run_cell  # noqa: E402
from jaka_regression.cell.stage import CellLaunch, CellStage  # noqa: E402
from jaka_regression.processes import ChildProcesses  # noqa: E402
from jaka_regression.scenario import parse_scenario  # noqa: E402
from jaka_regression.stage import Script  # noqa: E402
from jaka_ros_driver.errors import JakaError  # noqa: E402

CELL = ROOT / "test" / "data" / "cell"
NODE = Path(__file__).with_name("planted") / "every_way.py"
WITHOUT_DRIVER = ("driver:=false",)
FOLLOW = "/jaka_zu7_controller/follow_joint_trajectory/"
TOPICS = tuple("/jaka_driver/" + name for name in (
    "tool_position", "joint_position", "robot_states", "service_calls", "io_states", "motion_state", "rapid_rate",
    "robot_status")) + ("/joint_states", "/tf", "/jaka_zu7_controller/state", FOLLOW + "goal", FOLLOW + "result",
                        FOLLOW + "status")
GRIPPER = """
events:  # the gripper, whose switch is input 2
- {after_output: {index: 1, value: 1}, delay_s: 0.6, action: set_input, index: 2, value: 1}
- {after_output: {index: 1, value: 0}, delay_s: 0.4, action: set_input, index: 2, value: 0}
"""
CONVERT = "jaka_ros_driver/ros/convert.py"
CODEC = "jaka_ros_driver/protocol/codec.py"
PUBLISHERS = "jaka_ros_driver/ros/topics/state_publishers.py"
FOLLOWED = "jaka_ros_driver/ros/trajectories/messages.py"
FRAME = "jaka_ros_driver/simulation/controller/status_frame.py"
PROFILES = "jaka_ros_driver/simulation/arm/profiles.py"


class Defect(NamedTuple):
    """A defect: the file in which ``old`` becomes ``new``; None is the cell's node. Each ``old`` is there once."""

    path: Optional[str]
    old: str
    new: str


IN_NODE: Dict[str, Tuple[str, str]] = {
    "5 mm lower": ("DOWN = (364.4, 233.1, 313.1", "DOWN = (364.4, 233.1, 308.1"),
    "1 mm lower": ("DOWN = (364.4, 233.1, 313.1", "DOWN = (364.4, 233.1, 312.1"),
    "a joint 10 mrad off": ("ABOVE = (0.3, ", "ABOVE = (0.31, "),
    "the tool turned by 50 mrad": ("313.1, 2.528465", "313.1, 2.578465"),
    "joints slower": ("[], 0.8, 2.0", "[], 0.7, 2.0"),
    "joints accelerate less": ("[], 0.8, 2.0", "[], 0.8, 1.8"),
    "lines slower": ("[], 100.0, 400.0", "[], 90.0, 400.0"),
    "a line left out": ("line(UP)\n", ""),
    "the last grip left out": ("grip(0)\nwait_for(0)\n", ""),
    "another output": ("GRIP = 1 ", "GRIP = 3 "),
    "an analog output": ('DIGITAL = "digital"', 'DIGITAL = "analog"'),
    "a wait for the gripper dropped": ("wait_for(1)\n", ""),
    "a wait of 0.5 s dropped": ("rospy.sleep(0.5)\n", ""),
    "grip before the line": ("line(DOWN)\ngrip(1)\n", "grip(1)\nline(DOWN)\n"),
    "a move twice": ("line(UP)\n", "line(UP)\nline(UP)\n"),
    "another payload": ("SetPayload, 1, 1.5,", "SetPayload, 1, 2.5,"),
    "jog the other way": ("jog(4, 40.0", "jog(5, 40.0"),
    "jog slower": ("jog(4, 40.0", "jog(4, 30.0"),
    "jog for half as long": ("40.0, 0.8)", "40.0, 0.4)"),
    "servo stream 10 mrad wider": ("stream(0.05, 2.0)", "stream(0.055, 2.0)"),
    "servo stream in half the time": ("stream(0.05, 2.0)", "stream(0.05, 1.0)"),
    "the trajectory's middle 20 mrad off": ("(0.4, 3.0)", "(0.42, 3.0)"),
    "the trajectory 10 % longer": ("(0.0, 4.5))", "(0.0, 4.95))"),
}
IN_DRIVER: Dict[str, Tuple[str, str, str]] = {
    "tool pose in mm": (CONVERT, "return state.tcp_position + rotation_vector",
                        "return all_m_to_mm(state.tcp_position) + rotation_vector"),
    "x and y of the tool swapped": (CONVERT, "return state.tcp_position + rotation_vector",
                                    "return state.tcp_position[1::-1] + state.tcp_position[2:] + rotation_vector"),
    "tool 1 mm off": (CONVERT, "return state.tcp_position + rotation_vector",
                      "return tuple(a + 0.001 for a in state.tcp_position) + rotation_vector"),
    "rpy for the rotation vector": (CONVERT, "state.tcp_position + rotation_vector_from_rpy(state.tcp_rpy)",
                                    "state.tcp_position + state.tcp_rpy"),
    "inverse rotation vector": (CONVERT, "state.tcp_position + rotation_vector_from_rpy(state.tcp_rpy)",
                                "state.tcp_position + tuple(-a for a in rotation_vector_from_rpy(state.tcp_rpy))"),
    "joints in degrees": (PUBLISHERS, "+ state.joint_position +",
                          "+ tuple(57.29577951308232 * a for a in state.joint_position) +"),
    "joints reversed": (PUBLISHERS, "+ state.joint_position +", "+ state.joint_position[::-1] +"),
    "a joint 5 mrad off": (PUBLISHERS, "+ state.joint_position +",
                           "+ tuple(a + 0.005 for a in state.joint_position) +"),
    "joint names reversed": (CONVERT, "message.name = list(names)", "message.name = list(names)[::-1]"),
    "velocity twice as high": (PUBLISHERS, "+ (velocity or ())", "+ tuple(2.0 * a for a in velocity or ())"),
    "velocity missing": (PUBLISHERS, "    topic.publish(velocity is None",
                         "    velocity = None\n    topic.publish(velocity is None"),
    "running as error": (CONVERT, "(int(state.shown_motion_state(is_stream_moving)),",
                         "({3: 4}.get(int(state.motion_state), int(state.motion_state)),"),
    "running as paused": (CONVERT, "(int(state.shown_motion_state(is_stream_moving)),",
                          "({3: 1}.get(int(state.motion_state), int(state.motion_state)),"),
    "never running": (CONVERT, "(int(state.shown_motion_state(is_stream_moving)),", "(0,"),
    "power inverted": (CONVERT, "int(state.is_powered),", "int(not state.is_powered),"),
    "servo state never set": (CONVERT, "else is_servo_active", "else 0"),
    "collision always": (CONVERT, "int(state.protective_stop))", "1)"),
    "another frame": (CONVERT, "    message.header.frame_id = frame_id\n    linear, angular",
                      "    message.header.frame_id = frame_id + '_2'\n    linear, angular"),
    "transforms 1 mm off": (CONVERT, "translation.z = parent_t_child[9:]",
                            "translation.z = (a + 0.001 for a in parent_t_child[9:])"),
    "quaternion w negated": (CONVERT, "z * scale, math.cos(0.5 * angle)", "z * scale, -math.cos(0.5 * angle)"),
    "inputs and outputs swapped": (CONVERT, "digital_inputs=list(map(bool, terminals.digital_inputs))",
                                   "digital_inputs=list(map(bool, terminals.digital_outputs))"),
    "outputs inverted": (CONVERT, "digital_outputs=list(map(bool, terminals.digital_outputs))",
                         "digital_outputs=[not a for a in terminals.digital_outputs]"),
    "set_io sets nothing": (CONVERT, "c.SetDigitalOutput(bank, index, value != 0.0)",
                            "c.SetDigitalOutput(bank, index, False)"),
    "set_io sets the next terminal": (CONVERT, "c.SetDigitalOutput(bank, index, value != 0.0)",
                                      "c.SetDigitalOutput(bank, index + 1, value != 0.0)"),
    "joint speed 5 % lower": (CODEC, '"speed": rad_to_deg(move.speed)', '"speed": 0.95 * rad_to_deg(move.speed)'),
    "joint targets 3 mrad off": (CODEC, '"jointPosition": all_rad_to_deg(move.joint_position), "speed"',
                                 '"jointPosition": [a + 0.17 for a in all_rad_to_deg(move.joint_position)], "speed"'),
    "acceleration 20 % lower": (CODEC, '"accel": rad_to_deg(move.acceleration)',
                                '"accel": 0.8 * rad_to_deg(move.acceleration)'),
    "line speed 5 % higher": (CODEC, '"cartPosition": _pose(m.target), "speed": m_to_mm(m.speed)',
                              '"cartPosition": _pose(m.target), "speed": 1.05 * m_to_mm(m.speed)'),
    "jog in the tool frame": (CODEC, "c.JogFrame.BASE: 0", "c.JogFrame.BASE: 2"),
    "payload without its centre": (CODEC, '"centroid": all_m_to_mm(p.centroid)', '"centroid": [0.0, 0.0, 0.0]'),
    "every second sample not published": (PUBLISHERS, "        self._publish(sample)\n        self._repeater.arrived",
                                          "        if int(state.received_at * 125.0) % 2:\n"
                                          "            self._publish(sample)\n        self._repeater.arrived"),
    "samples of 40 ms ago under new stamps": (
        PUBLISHERS, "        self._velocity.add(state)\n",
        "        past = self.__dict__.setdefault('past', [])\n        past.append(state)\n"
        "        import dataclasses\n"
        "        state = dataclasses.replace(past.pop(0) if len(past) > 5 else state, received_at=state.received_at)\n"
        "        self._velocity.add(state)\n"),
    "stamps 50 ms old": (PUBLISHERS, "stamp = self.stamps.of(state)\n        sample",
                         "stamp = self.stamps.of(state) - rospy.Duration(0.05)\n        sample"),
    "desired and actual of a trajectory alike": (FOLLOWED, "message.desired = point_message(desired, seconds)",
                                                 "message.desired = JointTrajectoryPoint(positions=position)"),
}
IN_CONTROLLER: Dict[str, Tuple[str, str, str]] = {
    "joints 4 mrad off": (FRAME, '("joint_actual_position", lambda state: joints_to_wire(state.plant.joint_position,',
                          '("joint_actual_position", lambda state: joints_to_wire('
                          '[a + 0.004 for a in state.plant.joint_position],'),
    "tool pose 1 mm off": (FRAME, '("actual_position", lambda state: pose_to_wire(',
                           '("actual_position", lambda state: (lambda *p: [a + 1.0 for a in pose_to_wire(*p)])('),
    "in position at once": (FRAME, '("inpos", lambda state: state.in_position)', '("inpos", lambda state: True)'),
    "not powered": (FRAME, '("powered_on", lambda state: int(state.is_powered))', '("powered_on", lambda state: 0)'),
    "a collision for ever": (FRAME, '("protective_stop", lambda state: int(state.protective_stop))',
                             '("protective_stop", lambda state: 1)'),
    "an event without a reason": (FRAME, "errcode_text(state.alarms.shown()[0])", '"0x20031"'),
    "hand guiding shown": (FRAME, '("drag_status", lambda state: state.plant.is_hand_guided)',
                           '("drag_status", lambda state: True)'),
    "paused shown": (FRAME, '("paused", lambda state: state.is_paused)', '("paused", lambda state: True)'),
    "override of half the speed": (FRAME, '("rapidrate", lambda state: float(state.plant.rapid_rate))',
                                   '("rapidrate", lambda state: 0.5)'),
    "profile 10 % slower": (PROFILES, "self._max_acceleration = target, max_velocity, max_acc",
                            "self._max_acceleration = target, 0.9 * max_velocity, max_acc"),
    "jerk for twice as long": (PROFILES, "JERK_TIME_S = 0.05", "JERK_TIME_S = 0.1"),
    "outputs are set inverted": ("jaka_ros_driver/simulation/controller/io_banks.py", "int(value != 0) if",
                                 "int(value == 0) if"),
    "outputs are set one further": ("jaka_ros_driver/simulation/controller/io_banks.py",
                                    "values[index:index + len(new)] = [", "values[index + 1:index + 1 + len(new)] = ["),
}
HALF_A_TURN = "the flange points down all the time: half a turn and its inverse are the same orientation"
REASONS: Dict[str, str] = {
    "inverse rotation vector": HALF_A_TURN,
    "quaternion w negated": HALF_A_TURN,
    "joint speed 5 % lower": "no joint move is longer than 0.3 rad: 20 ms more, of timing.pace_floor_ms 25",
}
"""The reason why a defect may be missed, for those with which that happens."""


def defects() -> Dict[str, Defect]:
    """Return all defects by name, with the place into which each is planted."""
    found = {"node: " + name: Defect(None, *words) for name, words in IN_NODE.items()}
    for place, some in (("driver: ", IN_DRIVER), ("controller: ", IN_CONTROLLER)):
        found.update((place + name, Defect(*words)) for name, words in some.items())
    return found


class Cell:
    """A folder with the cell's package and its golden log."""

    def __init__(self, folder: Path) -> None:
        self.golden = folder / "golden.mcap"
        self.launch = folder / "my_cell" / "cell.launch"
        shutil.copytree(str(CELL), str(folder / "my_cell"))
        self.write(NODE.read_text(encoding="utf-8"))

    def write(self, text: str) -> None:
        path = self.launch.with_name("pick_and_place.py")
        path.write_text(text, encoding="utf-8")
        path.chmod(0o755)

    def record(self, place: Path) -> None:
        """Record the first run as the golden log."""
        place.mkdir()
        scenario = parse_scenario(GRIPPER, "gripper")
        with ChildProcesses() as some:
            stage = CellStage(some, place, Script(None, (), 0.0, TOPICS), scenario)
            problem = stage.run_cell(self.golden, command_lines.DRIVER, CellLaunch(
                self.launch, WITHOUT_DRIVER, (), 0.0, 0.0))
        if problem:
            raise JakaError(problem)

    def run(self, place: Path, defect: Optional[Defect]) -> Tuple[bool, str]:
        """Run the node with a defect; return whether it is the same, and the summary."""
        text = NODE.read_text(encoding="utf-8")
        driver: Sequence[str] = command_lines.DRIVER
        simulation = command_lines.SIMULATION
        if defect is not None and defect.path is None:
            text = replaced(text, defect)
        elif defect is not None:
            copy = place.with_suffix(".source")
            shutil.copytree(str(ROOT / "jaka_ros_driver"), str(copy / "jaka_ros_driver"),
                            ignore=shutil.ignore_patterns("__pycache__"))
            path = copy / defect.path
            path.write_text(replaced(path.read_text(encoding="utf-8"), defect), encoding="utf-8")
            if "/simulation/" in defect.path:
                command_lines.SIMULATION = ("-c", "import sys; sys.path.insert(0, %r); %s" % (str(copy), simulation[1]))
            else:
                driver = command_lines.driver_in(str(copy))
        self.write(text)
        try:
            result = run_cell(self.launch, self.golden, place, WITHOUT_DRIVER, driver=driver)
        except JakaError as error:
            return False, "failed: %s" % str(error).splitlines()[0]
        finally:
            command_lines.SIMULATION = simulation
        return result.same, result.summary


def replaced(text: str, defect: Defect) -> str:
    assert text.count(defect.old) == 1, "%d times: %s" % (text.count(defect.old), defect.old)
    return text.replace(defect.old, defect.new)


def main() -> int:
    """Run the node unchanged and with each defect; print what the comparison says."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--only", default="", metavar="WORDS", help="the defects whose names have these words")
    parser.add_argument("--unchanged", type=int, default=5, metavar="N", help="unchanged runs first, default 5")
    options = parser.parse_args()
    folder = Path(tempfile.mkdtemp(prefix="soak_planted_"))
    os.environ["ROS_PACKAGE_PATH"] = "%s:%s" % (folder, os.environ.get("ROS_PACKAGE_PATH", ""))
    cell = Cell(folder)
    cell.record(folder / "first")
    wrong = 0
    planted = {name: defect for name, defect in defects().items() if options.only in name}
    missed = []
    for number, name in enumerate(["unchanged"] * options.unchanged + list(planted)):
        began = time.monotonic()
        place = folder / ("%03d" % number)
        is_same, words = cell.run(place, planted.get(name))
        if name == "unchanged":
            wrong += not is_same
        elif is_same:
            missed.append(name)
            wrong += name.split(": ")[1] not in REASONS
        headline = next((line for line in words.splitlines() if "begins with" in line), words.splitlines()[-1])
        print("%5.1f s  %-55s %s" % (time.monotonic() - began, name, "same" if is_same else headline[:110]), flush=True)
    for name in missed:
        print("missed: %s (%s)" % (name, REASONS.get(name.split(": ")[1], "no reason known")))
    print("%d defects planted, %d found; logs in %s" % (len(planted), len(planted) - len(missed), folder))
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
