"""The command jaka_bag replay-motion without a driver: dry runs, limits from the log or a file, other arms."""
import json
import os

import pytest
from motion_logs import JOINTS, log_of, session, with_parameters

from jaka_bag.cli.main import main
from jaka_regression.motion.limits import UnknownLimits, limits_from_urdf, same_model
from jaka_ros_driver.kinematics.arm_models import load_model
from jaka_ros_driver.kinematics.limits import stream_limits
from jaka_ros_driver.kinematics.urdf import urdf_from_model


@pytest.fixture(autouse=True)
def no_master(monkeypatch):
    monkeypatch.setenv("ROS_MASTER_URI", "http://127.0.0.1:1")


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("logs")
    log_of(folder / "bare.bag", session())
    with_parameters(folder / "bare.bag", folder / "zu3.mcap", "zu3")
    (folder / "zu7.urdf").write_text(urdf_from_model(load_model("zu7"), "left_"), encoding="utf-8")
    return folder


def test_a_dry_run_draws_the_motion_with_the_limits_of_the_log(logs, tmp_path, capsys):
    target = tmp_path / "motion.html"
    assert main(["replay-motion", str(logs / "zu3.mcap"), "--dry-run", "-o", str(target)]) == 0
    said = capsys.readouterr().out
    assert "motion.html: the motion to be sent" in said and "points" in said
    page = target.read_text(encoding="utf-8")
    assert page.count("<svg") == 8 and "zu3" in page and "Nothing has been sent" in page
    assert main(["replay-motion", str(logs / "zu3.mcap"), "--dry-run", "-o", str(target)]) == 1
    assert "exists (--force overwrites it)" in capsys.readouterr().err


def test_without_a_name_the_picture_lies_beside_the_log_and_json_has_the_facts(logs, capsys):
    assert main(["replay-motion", str(logs / "zu3.mcap"), "-n", "--force", "--json", "--speed", "0.5"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["model"] == "zu3" and told["speed"] == 0.5 and told["end"] is None
    assert told["duration_s"] == pytest.approx(told["recorded_s"] / 0.5, abs=0.7)
    assert os.path.exists(str(logs / "zu3.motion.html")) and told["standstill_cut_s"]["before"] > 0.5


def test_pictures_are_made_by_matplotlib_too(logs, tmp_path, capsys):
    assert main(["replay-motion", str(logs / "zu3.mcap"), "-n", "-o", str(tmp_path / "a.png")]) == 0
    assert (tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")
    assert main(["replay-motion", str(logs / "zu3.mcap"), "-n", "-o", str(tmp_path / "a.gif")]) == 1
    assert ".html, .svg, .png" in capsys.readouterr().err


def test_limits_that_nobody_tells_are_asked_for(logs, tmp_path, capsys):
    log, target = str(logs / "bare.bag"), str(tmp_path / "a.html")
    assert main(["replay-motion", log, "-n", "-o", target]) == 1
    assert "the limits of the arm are not known" in capsys.readouterr().err
    assert main(["replay-motion", log, "-n", "-o", target, "--description", str(logs / "zu7.urdf")]) == 0
    said = capsys.readouterr()
    assert "does not tell with which arm it was recorded" in said.err and "limits of the zu7" in said.err
    assert main(["replay-motion", log]) == 1
    assert "no ROS master" in capsys.readouterr().err


def test_another_arms_log_is_refused_unless_that_is_wanted(logs, tmp_path, capsys):
    words = ["replay-motion", str(logs / "zu3.mcap"), "-n", "--description", str(logs / "zu7.urdf"), "-o",
             str(tmp_path / "a.html")]
    assert main(words) == 1
    assert "was recorded with a zu3, and this arm is a zu7; --any-model" in capsys.readouterr().err
    assert main([*words, "--any-model"]) == 0


@pytest.mark.parametrize("words", [["--speed", "0"], ["--speed", "11"], ["--duration", "1", "--until", "2"]])
def test_what_makes_no_sense_is_usage(logs, words):
    assert main(["replay-motion", str(logs / "zu3.mcap"), "-n", *words]) == 2


def test_help_has_two_examples(capsys):
    assert main(["replay-motion", "--help"]) == 0
    said = capsys.readouterr().out
    assert said.count("  jaka_bag replay-motion guided.mcap") == 2 and "Exit code" in said


def test_limits_are_those_of_the_urdf():
    limits = limits_from_urdf(urdf_from_model(load_model("zu7"), "left_"), JOINTS)
    model = load_model("zu7")
    assert limits.model == "zu7" and list(limits.low) == [low for low, _ in stream_limits(model)]
    assert (limits.speed <= 3.1416).all() and limits.acceleration[0] == pytest.approx(12.566, abs=1e-3)


@pytest.mark.parametrize("text, words", [
    ("nonsense", "no XML"), ("<robot name='a'/>", "has no joint joint_1"),
    ("<robot><joint name='joint_1' type='revolute'/></robot>", "no joint joint_2|no limits"),
    ("<robot>%s</robot>" % "".join("<joint name='%s'><limit lower='0' upper='x' velocity='1'/></joint>" % name
                                   for name in JOINTS), "no limits .* for joint joint_1"),
    ("<robot>%s</robot>" % "".join("<joint name='%s_%s'/>" % (side, name) for side in "ab" for name in JOINTS),
     "several that could be joint joint_1")])
def test_descriptions_without_limits_say_what_is_missing(text, words):
    with pytest.raises(UnknownLimits, match=words):
        limits_from_urdf(text, JOINTS)


def test_names_of_one_model():
    assert same_model("JAKA_Zu 7", "zu7") and same_model("zu7", "jaka_zu7") and not same_model("zu7", "zu3")
