"""The refusals of replay-commands before any call is made; without ROS, on logs that lack what it goes by."""
import math

import numpy as np
import pytest
from synthetic_session import Call, Session, moves, simulate, write_log

from jaka_bag.cli.main import main
from jaka_bag.compare.runs.loading import load_run
from jaka_bag.compare.runs.run import Run
from jaka_bag.messages.connection import Connection
from jaka_regression import preconditions, replay_commands
from jaka_regression.driver_inputs import SentMessage

MOVE = Call(1.0, 0.5, "joint_move", "pose: 0")


@pytest.fixture
def played(monkeypatch):
    """Return the list of plans that would have been played."""
    plans = []
    monkeypatch.setattr(replay_commands, "_play", lambda _args, _log, planned: plans.append(planned) or 0)
    return plans


def log_of(path, calls=None, *lacking, change=None):
    session: Session = simulate(moves(1))
    session.calls = session.calls if calls is None else calls
    for name in lacking:
        session.keep[name][:] = False
    if change is not None:
        change(session)
    return str(write_log(path, session))


def nowhere(session):
    session.joints[:] = np.nan


@pytest.mark.parametrize("lacking, change", [(("joint_position",), None), ((), nowhere)], ids=["none", "no number"])
def test_nothing_moves_that_the_log_does_not_place(tmp_path, played, capsys, lacking, change):
    log = log_of(tmp_path / "log.mcap", [MOVE], *lacking, change=change)
    assert main(["replay-commands", log]) == 1
    errors = capsys.readouterr().err
    assert "/jaka_driver" in errors and "--anyway start" in errors and not played
    assert main(["replay-commands", log, "--anyway", "start"]) == 0 and len(played) == 1


def test_a_log_that_places_its_arm_or_moves_none_is_played(tmp_path, played):
    assert main(["replay-commands", log_of(tmp_path / "a.mcap")]) == 0
    output = [Call(1.0, 0.1, "set_io", "index: 0")]
    assert main(["replay-commands", log_of(tmp_path / "b.mcap", output, "joint_position")]) == 0
    assert len(played) == 2


def test_another_arms_joints_place_no_arm(tmp_path):
    left, right = simulate(moves(1)), simulate(moves(1))
    left.node, right.node = "/left/jaka_driver", "/right/jaka_driver"
    right.keep["joint_position"][:] = False
    run = load_run(write_log(tmp_path / "log.mcap", left, right), with_contents=False)
    found = preconditions.unchecked_starts(run, run.calls)
    assert [difference.key for difference in found] == ["start"]
    assert "/right" in found[0].text and "/left" not in found[0].text


@pytest.mark.parametrize("topic, is_found", [
    ("/jaka_driver/jog_joints", False), ("/right/jaka_driver/jog_joints", True),
    ("/right/jaka_zu7_controller/follow_joint_trajectory/goal", True), ("/right/joint_path_command", True),
    ("/joint_path_command", False), ("/right/jaka_zu7_controller/follow_joint_trajectory/cancel", False)])
def test_a_message_needs_the_joints_of_its_own_arm(tmp_path, topic, is_found):
    run = load_run(log_of(tmp_path / "log.mcap"), with_contents=False)
    message = SentMessage(Connection(topic, "t/T", "0" * 32, "", ""), 1.0, 0.0, b"", "", True, 0)
    assert bool(preconditions.unchecked_starts(run, [message])) is is_found


def test_that_the_tools_pose_is_not_compared_is_said(tmp_path, capsys):
    args = replay_commands.argparse.Namespace(log=log_of(tmp_path / "log.mcap", [MOVE], "tool_position"), anyway=[],
                                              quiet=False, progress=False)

    class Client:
        def conditions(self, *_):
            return {}

    replay_commands._check_conditions(args, Client(), load_run(args.log, with_contents=False), "/jaka_driver")
    assert "tool pose" in capsys.readouterr().out


@pytest.mark.parametrize("service", ["program/play", "program/resume", "resume", "set_speed_slider"])
def test_a_speed_limit_is_refused_where_it_would_not_hold(tmp_path, played, capsys, service):
    log = log_of(tmp_path / "log.mcap", [MOVE._replace(start=0.2), Call(1.0, 0.1, service, "")])
    assert main(["replay-commands", log, "--speed-limit", "25"]) == 2
    assert service in capsys.readouterr().err and not played
    assert main(["replay-commands", log, "--dry-run", "--speed-limit", "25"]) == 2
    assert main(["replay-commands", log, "--dry-run"]) == 0


def test_a_joint_that_is_no_number_stands_nowhere():
    args = replay_commands.argparse.Namespace(wait=0.1, start_tolerance=0.01, go_to_start=False)

    class Client:
        def joint_position(self, *_):
            return (0.0, math.nan)

    with pytest.raises(replay_commands.BagError, match="joint 2"):
        replay_commands._check_start(args, Client(), "/jaka_driver/joint_position", [0.0, 0.0])


def test_no_log_needs_no_start():
    assert preconditions.unchecked_starts(Run("log.mcap", 0, 1.0), []) == []
