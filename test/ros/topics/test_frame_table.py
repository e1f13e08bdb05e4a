"""The tool and user frames of the controller: looked up by id, unknown where they may have changed."""
import math
import threading
from types import SimpleNamespace

import numpy as np
import pytest

from jaka_ros_driver import commands as c
from jaka_ros_driver.errors import CommandRejected, ConnectionLost, InvalidCommand
from jaka_ros_driver.kinematics.rotations import IDENTITY, transform_from_pose
from jaka_ros_driver.ros.frame_table import FrameReader
from jaka_ros_driver.state import RobotState

TOOLS = tuple(c.Pose((0.0, 0.0, 0.01 * n), (0.0, 0.0, 0.1 * n)) for n in range(4))
USERS = tuple(c.Pose((0.1 * n, 0.0, 0.0), (0.0, 0.1 * n, 0.0)) for n in range(3))
WAIT_S = 10.0


class Controller:
    """An arm that answers the table's questions; the first of them waits until ``may_answer``."""

    def __init__(self):
        self.link_health = SimpleNamespace(connections=1)
        self.tools, self.users = TOOLS, USERS
        self.payload, self.level = c.SetPayload(1.5, (0.0, 0.0, 0.05)), 4
        self.known = "nothing"
        self.may_answer, self.was_asked, self.has_read = threading.Event(), threading.Event(), threading.Semaphore(0)
        self.may_answer.set()

    def know_tools(self, tools):
        self.known = tools

    def execute(self, query):
        self.was_asked.set()
        assert self.may_answer.wait(WAIT_S)
        if query is c.Query.TOOL_FRAMES:
            return self.tools
        if query in (c.Query.PAYLOAD, c.Query.COLLISION_LEVEL):
            answer = self.payload if query is c.Query.PAYLOAD else self.level
            if answer is None:
                raise CommandRejected(query.name, 1, "unknown")
            return answer
        self.has_read.release()
        if self.users is None:
            raise ConnectionLost("no link")
        return self.users


def state_with(tool=0, user=0):
    return RobotState((0.0,) * 6, True, True, True, False, False, tool_id=tool, user_frame_id=user)


@pytest.fixture
def controller():
    return Controller()


@pytest.fixture
def table(controller):
    table = FrameReader(controller)
    yield table
    controller.may_answer.set()
    table.close()


def read(table):
    """Let the table read once, without its thread."""
    table._read_all()
    return table


def test_before_anything_was_read_the_flange_and_the_base_alone_are_known(table):
    assert table.flange_t_tool(state_with()) == table.base_t_user(state_with()) == IDENTITY
    assert table.flange_t_tool(state_with(tool=1)) is None and table.base_t_user(state_with(user=1)) is None


def test_a_controller_that_does_not_tell_its_ids_uses_flange_and_base(table):
    state = state_with(tool=None, user=None)
    assert read(table).flange_t_tool(state) == table.base_t_user(state) == IDENTITY


def test_the_arm_s_motion_guard_knows_the_tools_unless_they_may_have_changed(table, controller):
    read(table)
    assert controller.known == tuple(map(transform_from_pose, TOOLS))
    with table.changing():
        assert controller.known is None


def test_tools_and_user_frames_are_found_by_their_own_ids(table):
    read(table)
    assert table.flange_t_tool(state_with(tool=3, user=1)) == transform_from_pose(TOOLS[3])
    assert table.base_t_user(state_with(tool=3, user=1)) == transform_from_pose(USERS[1])


@pytest.mark.parametrize("beyond", [-1, 4, 5])
def test_an_id_that_the_controller_has_no_frame_for_is_unknown(table, beyond):
    assert read(table).flange_t_tool(state_with(tool=beyond)) is None


def test_inside_a_change_nothing_is_known_also_what_is_read_meanwhile(table):
    read(table)
    with table.changing():
        assert table.flange_t_tool(state_with(tool=1)) is None
        assert read(table).flange_t_tool(state_with(tool=1)) is None
    assert table.flange_t_tool(state_with(tool=1)) is None
    assert read(table).flange_t_tool(state_with(tool=1)) == transform_from_pose(TOOLS[1])


def read_during(change, table, controller):
    """Have a change begin and end while the controller has been asked, and has not answered."""
    controller.may_answer.clear()
    reader = threading.Thread(target=table._read_all)
    reader.start()
    assert controller.was_asked.wait(WAIT_S)
    with change():
        pass
    controller.may_answer.set()
    reader.join(WAIT_S)


def test_what_was_asked_before_a_change_is_not_kept_after_it(table, controller):
    read_during(table.changing, table, controller)
    assert table.flange_t_tool(state_with(tool=1)) is None


def test_frames_are_read_again_at_once_after_a_change_and_a_new_connection(table, controller):
    table.start()
    assert controller.has_read.acquire(timeout=WAIT_S)
    with table.changing():
        controller.tools = tuple(c.Pose((0.0, 0.0, 1.0), (0.0, 0.0, math.pi / 2)) for _ in range(4))
    assert controller.has_read.acquire(timeout=2.0), "sooner than after the usual 5 s"
    controller.link_health = SimpleNamespace(connections=2)
    assert controller.has_read.acquire(timeout=2.0)


class ToldTime:
    """An event that nobody sets, and a clock that goes on by its waiting; the table ends after ``lasts`` s."""

    def __init__(self, table, lasts):
        self._table, self._lasts, self.now = table, lasts, 0.0

    def is_set(self):
        return False

    set = clear = is_set

    def wait(self, seconds):
        self.now += seconds
        self._table._is_closing = self.now > self._lasts


def test_replies_that_are_held_back_are_asked_for_each_second_and_others_every_five(table, controller):
    time, asked_at = ToldTime(table, 20.0), []

    def execute(query):
        if query is c.Query.TOOL_FRAMES:
            asked_at.append(time.now)
            if time.now < 3.5:
                raise InvalidCommand("refused: the controller may hold its replies back")
            return TOOLS
        return USERS

    controller.execute, table._wake = execute, time
    table._run()
    assert asked_at == pytest.approx([0.0, 1.0, 2.0, 3.0, 4.0, 9.0, 14.0, 19.0], abs=0.9)
    assert np.diff(asked_at) == pytest.approx([1.0] * 4 + [5.0] * 3, abs=0.25)


def test_a_new_connection_is_noticed_within_a_quarter_of_a_second(table, controller):
    time, asked_at = ToldTime(table, 4.0), []

    def execute(query):
        asked_at.append(time.now)
        return TOOLS

    controller.execute, table._wake = execute, time
    wait = time.wait

    def connect_meanwhile(seconds):
        if time.now < 2.0 <= time.now + seconds:
            controller.link_health = SimpleNamespace(connections=2)
        wait(seconds)

    time.wait = connect_meanwhile
    table._run()
    assert asked_at == pytest.approx([0.0] * 4 + [2.0] * 4, abs=0.25)


def test_frames_that_cannot_be_read_are_unknown_and_the_others_are_not(table, controller):
    controller.users = None
    read(table)
    assert table.base_t_user(state_with(user=1)) is None
    assert table.flange_t_tool(state_with(tool=1)) == transform_from_pose(TOOLS[1])


def test_load_and_collision_level_are_read_and_what_the_controller_does_not_tell_is_unknown(table, controller):
    assert table.payload is None and table.collision_level is None
    read(table)
    assert table.payload == c.SetPayload(1.5, (0.0, 0.0, 0.05)) and table.collision_level == 4
    controller.payload = None
    read(table)
    assert table.payload is None and table.collision_level == 4


@pytest.mark.parametrize("change", ["changing_load", "changing"])
def test_inside_a_change_the_load_is_not_known_also_what_is_read_meanwhile(table, controller, change):
    read(table)
    with getattr(table, change)():
        assert table.payload is None and table.collision_level is None
        with table.changing_load():
            pass
        read(table)
        assert change == "changing" or table.payload is None
    assert table.payload is None and table.collision_level is None
    controller.level = 2
    assert read(table).collision_level == 2


def test_a_load_that_was_asked_for_before_a_change_is_not_kept_after_it(table, controller):
    read_during(table.changing_load, table, controller)
    assert table.payload is None and table.flange_t_tool(state_with(tool=1)) is not None


def test_closing_waits_for_the_thread():
    controller = Controller()
    controller.may_answer.clear()
    table = FrameReader(controller)
    table.start()
    assert controller.was_asked.wait(WAIT_S)
    threading.Timer(0.3, controller.may_answer.set).start()
    table.close()
    assert "frame table" not in {thread.name for thread in threading.enumerate()}
