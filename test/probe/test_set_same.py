"""The stage set beside controllers that do not do as they are told: what it leaves, and what it says of that."""
import contextlib
import json
import os
import signal
import subprocess
import sys
import threading
import time
from types import SimpleNamespace

import pytest

from jaka_ros_driver.probe import command, report
from jaka_ros_driver.probe.ask import TimedReply
from jaka_ros_driver.probe.facts import Fact
from jaka_ros_driver.probe.set_same import SETTINGS, Desk, SetBack, StageEnded, _is_equal, set_same, uninterrupted
from jaka_ros_driver.state import RobotState


class OddController(Desk):
    """A controller in memory, with the deviations that a test gives it.

    Args:
        keys: The keys of ``set_user_offsets`` that it reads.
        get_base: The index of its first output in ``get_digital_output``.
        set_base: The same in ``set_digital_output``.
    """

    def __init__(self, keys=("userffset", "useroffset"), get_base=0, set_base=0):
        super().__init__(None, 0, SimpleNamespace(states=[RobotState((0.0,) * 6, *([True] * 3), False, False, tool_id=0,
                                                                     user_frame_id=1, is_hand_guided=False)]))
        self.keys, self.get_base, self.set_base = keys, get_base, set_base
        self.tools, self.users = ([[0.0] * 6 for _ in range(4)] for _ in range(2))
        self.users[1][0] = 200.0
        self.terminals = [0, 1, 1, 0, 0]
        self.payload = {"mass": 1.23456789, "centroid": [0.0, 10.0, 40.0]}
        self.period_ms, self.shortest_ms, self.periods_refused = 30, 1, ""
        self.is_sticky = self.is_wild = False
        self.ended_at = ""
        self.sent = []

    def ask(self, name, patience=0.0, **parameters):
        self.sent.append((name, parameters))
        try:
            reply = self._reply(name, parameters)
        except (KeyError, IndexError):
            return TimedReply({"cmdName": name, "errorCode": "2"}, 0.01)
        return TimedReply({"cmdName": name, "errorCode": "0", **(reply or {})}, 0.01)

    def _reply(self, name, given):
        if name == "get_payload":
            return dict(self.payload)
        if name == "set_payload":
            self.payload = {"mass": round(given["mass"], 0 if self.is_sticky else 6), "centroid": given["centroid"]}
        if name == "get_clsn_sensitivity":
            return {"sensitivityLevel": 3}
        if name in ("get_curr_tool_id", "get_curr_user_id"):
            return {"id": 0 if "tool" in name else 1}
        if name in ("get_tool_offsets", "get_user_offsets"):
            kind, table = name.split("_")[1], self.tools if "tool" in name else self.users
            return {kind + "_offsets": [list(row) for row in table]}
        if name == "set_tool_offsets":
            self.tools[0 if self.is_wild else given["id"]] = [1.0] * 6 if self.is_wild else list(given["tooloffset"])
        if name == "set_user_offsets":
            self.users[given["id"]] = list(given[next(key for key in (*self.keys, "") if key in given or not key)])
        if name == "get_port10000_delay_ms":
            return {"port10000_delay_ms": self.period_ms}
        if name == "set_port10000_delay_ms":
            if self.periods_refused and len(self.sent_names(name)) <= 2:
                return {"errorCode": self.periods_refused}
            self.period_ms = given["port10000_delay_ms"]
        if name == "get_drag_status":
            return {"status": False}
        if name == "get_digital_output":
            return {"value": self.terminals[given["index"] - self.get_base]}
        if name == "set_digital_output":
            self.terminals[given["index"] - self.set_base] = given["value"]
        return None

    def frames(self, seconds):
        period = 1e-3 * max(self.period_ms, self.shortest_ms)
        return [number * period for number in range(int(seconds / period))]

    def outputs(self, seconds):
        return tuple(self.terminals)

    def sent_names(self, name):
        return [given for one, given in self.sent if one == name]

    def require_rest(self):
        if self.ended_at and self.sent and self.sent[-1][0] == self.ended_at:
            raise StageEnded("the arm moves")


def run(desk, output=None, answer=""):
    facts, back = {"commands_missing": Fact([], "")}, SetBack()
    before = ([list(row) for row in desk.users], list(desk.terminals))
    with contextlib.suppress(StageEnded):
        set_same(desk, facts, back, output, lambda question: answer, lambda line: None)
    return facts, back.left, (desk.users, desk.terminals) == before


@pytest.mark.parametrize("keys, told", [(("userffset", "useroffset"), "either"), (("userffset",), "userffset"),
                                        (("useroffset",), "useroffset"), ((), None)])
def test_the_key_that_is_read_is_found_on_a_frame_that_is_zero_again(keys, told):
    desk = OddController(keys)
    facts, left, is_same = run(desk)
    assert facts["user_frame_key"].value == told and is_same and not left
    written = [given["id"] for name, given in desk.sent if name == "set_user_offsets"]
    assert 1 not in written and 0 not in written, "the active frame and the base stay"
    assert "set_digital_output" not in [name for name, _ in desk.sent]


@pytest.mark.parametrize("get_base, set_base", [(0, 0), (1, 1), (0, 1), (1, 0)])
@pytest.mark.parametrize("terminals", [[0, 0, 0, 0, 0], [1, 1, 1, 1, 1], [0, 0, 1, 0, 0], [0, 0, 0, 1, 0]])
def test_the_base_is_that_of_the_command_that_sets_however_values_are_read(get_base, set_base, terminals):
    desk = OddController(get_base=get_base, set_base=set_base)
    desk.terminals = list(terminals)
    facts, left, is_same = run(desk, output=3)
    assert is_same and not left, desk.terminals
    touched = {given["index"] - set_base for name, given in desk.sent if name == "set_digital_output"}
    assert touched == {3 - set_base}
    assert facts["io_index_base"].value in (set_base, None)
    assert facts["io_index_base"].value is not None or get_base != set_base
    assert facts["io_terminal"].value is None


@pytest.mark.parametrize("answer, base, terminal", [("3", 1, 3), ("2", 1, 2), ("7", None, 7), ("", 1, None),
                                                    ("the third", 1, None)])
def test_a_person_who_sees_another_terminal_leaves_the_base_open(answer, base, terminal):
    facts, _, is_same = run(OddController(get_base=1, set_base=1), 3, answer)
    assert (facts["io_index_base"].value, facts["io_terminal"].value) == (base, terminal) and is_same


def test_what_could_not_be_set_back_is_told_first():
    desk = OddController()
    desk.is_sticky = True
    facts, left, _ = run(desk)
    assert len(left) == 1 and left[0].startswith("set_payload: was {'mass': 1.23456789") and "'mass': 1.0" in left[0]
    assert "set_payload" not in facts["same_values"].value
    assert report.text(facts, left)[0] == "NOT SET BACK"
    assert report.as_json(facts, [], False, left)["not_set_back"] == left


@pytest.mark.parametrize("told, shortest, refused, seen, sent", [
    (30, 1, "", 0.008, [8, 30]), (30, 20, "", 0.02, [8, 30]), (8, 1, "", 0.008, [8]), (30, 500, "", None, [8, 30]),
    (30, 1, "1", None, [8]), (30, 1, "2", None, [8]), (0, 1, "", None, []), ("30 ms", 1, "", None, []),
    (float("nan"), 1, "", None, [])])
def test_the_period_of_the_feed_is_what_it_was_after_the_drivers_was_asked_for(told, shortest, refused, seen, sent):
    desk = OddController()
    desk.period_ms, desk.shortest_ms, desk.periods_refused = told, shortest, refused
    facts, left, _ = run(desk)
    assert facts["feed_period_asked"].value == (seen and pytest.approx(seen, rel=0.01)) and not left
    assert [given["port10000_delay_ms"] for given in desk.sent_names("set_port10000_delay_ms")] == sent
    assert ("set_port10000_delay_ms" in facts["commands_missing"].value) is (refused == "1")


def test_a_period_that_is_not_set_back_is_told():
    desk, plain = OddController(), OddController.ask

    def ask(name, patience=0.0, **given):
        return plain(desk, name, patience, **{key: 8 if key == "port10000_delay_ms" else value
                                             for key, value in given.items()})
    desk.ask = ask
    facts, left, _ = run(desk)
    assert left == ["period of the feed, ms: was 30, is 8"]


def test_nothing_more_is_written_to_a_table_that_one_id_changed_elsewhere():
    desk = OddController()
    desk.is_wild = True
    facts, left, _ = run(desk)
    assert [given["id"] for name, given in desk.sent if name == "set_tool_offsets"] == [1, 1]
    assert facts["tool_ids"].value is None and left[0].startswith("tool frames, after id 1")


def test_an_arm_that_moves_ends_the_stage():
    desk = OddController()
    desk.ended_at = "get_clsn_sensitivity"
    facts, left, is_same = run(desk)
    assert is_same and not left and set(facts) == {"commands_missing", "same_values"}
    assert not {name for name, _ in desk.sent} & (set(SETTINGS) - {"set_payload", "set_clsn_sensitivity"})


@pytest.mark.parametrize("name", ["set_user_offsets", "set_digital_output"])
def test_what_was_changed_is_set_back_by_whatever_a_step_is_ended(name):
    desk, plain, ended = OddController(), OddController.ask, []
    before = [list(row) for row in desk.users], list(desk.terminals)

    def ask(*words, **parameters):
        reply = plain(desk, *words, **parameters)
        if words[0] == name and (desk.users, desk.terminals) != before and not ended:
            ended.append(True)
            raise RuntimeError("a defect")
        return reply
    desk.ask = ask
    with pytest.raises(RuntimeError):
        run(desk, output=3)
    assert ended and (desk.users, desk.terminals) == before


@pytest.mark.parametrize("shown", [None, (), (0,)])
@pytest.mark.parametrize("base, index", [(0, 1), (1, 2), (0, 3), (1, 4)])
def test_an_output_that_no_frame_shows_any_more_is_switched_back_and_to_nothing_else(base, index, shown):
    desk, frames = OddController(get_base=base, set_base=base), []
    before = list(desk.terminals)
    desk.outputs = lambda seconds: shown if frames or frames.append(True) else tuple(desk.terminals)
    facts, left, is_same = run(desk, output=index)
    sent = [given["value"] for name, given in desk.sent if name == "set_digital_output"]
    assert is_same and sent[0] != before[index - base] and set(sent[1:]) == {before[index - base]}, sent
    assert "could not be read back" in left[-1] and facts["io_index_base"].value is None


_RUN = """
import os, signal, sys
from test_set_same import OddController
from jaka_ros_driver.probe import command
from jaka_ros_driver.probe.set_same import _switch_output
number = int(sys.argv[1])
signal.signal(number, signal.SIG_DFL)  # what the tests run in, as nohup, may ignore some
signal.signal(signal.SIGINT, signal.default_int_handler)
desk, plain = OddController(), OddController.ask

def ask(name, patience=0.0, **given):
    if name == "set_digital_output" and given["value"] == 0:  # the way back of what is refused
        return plain(desk, "no_such_command")
    reply = plain(desk, name, patience, **given)
    if name == "set_digital_output":
        os.kill(os.getpid(), number)
    return reply
desk.ask = ask
command._Run.stages = lambda run: _switch_output(desk, run._facts, run._back, 3, lambda question: "") or 0
sys.exit(command.main(["10.0.0.1", "--out", sys.argv[2], "--stage", "set"]))
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT])
def test_a_signal_loses_no_account_of_what_is_not_set_back(tmp_path, number):
    paths = os.pathsep.join([os.path.dirname(__file__), *filter(None, sys.path)])
    done = subprocess.run([sys.executable, "-c", _RUN, str(int(number)), str(tmp_path / "out")], text=True,
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=120.0,
                          env={**os.environ, "PYTHONPATH": paths})
    assert done.returncode == 128 + number and "Traceback" not in done.stdout, done.stdout
    content = json.loads((tmp_path / "out" / "probe.json").read_text())
    assert content["not_set_back"] == ["outputs 2 and 3, counted from 0: was [1, 0], is [1, 1]"]
    assert content["is_whole"] is False and "NOT SET BACK" in done.stdout and "ended by" in done.stdout


def test_a_closed_output_does_not_keep_the_report_from_being_written(tmp_path, monkeypatch):
    monkeypatch.setattr(command._Run, "stages",
                        lambda run: run._back.left.append("an output") or command._tell("a line") or 1)

    def closed(*words, **options):
        raise OSError("Input/output error")
    monkeypatch.setattr("builtins.print", closed)
    command.main(["10.0.0.1", "--out", str(tmp_path / "out")])
    assert json.loads((tmp_path / "out" / "probe.json").read_text())["not_set_back"] == ["an output"]


@pytest.mark.parametrize("odd", [10 ** 400, float("nan"), "x", None, [1.0]])
def test_a_number_that_no_float_holds_is_another_value(odd):
    assert not _is_equal({"mass": odd}, {"mass": 1.0}) and _is_equal({"mass": 1.0000001}, {"mass": 1})


def test_a_signal_waits_though_another_thread_can_take_it(ctrl_c):
    ended, seen = threading.Event(), []
    other = threading.Thread(target=ended.wait)
    other.start()
    try:
        with pytest.raises(KeyboardInterrupt), uninterrupted():
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(0.1)
            seen.append("the end")
    finally:
        ended.set()
        other.join()
    assert seen
