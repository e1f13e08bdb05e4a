import copy
import math

import pytest
import yaml

from jaka_ros_driver.errors import InvalidCommand, JakaError
from jaka_ros_driver.kinematics import arm_models
from jaka_ros_driver.kinematics.arm_models import load_model, load_model_file, model_names

with open(arm_models.MODELS_FILE, encoding="utf-8") as _file:
    DATA = yaml.safe_load(_file)


def entry(name="zu5", **changes):
    values = copy.deepcopy(DATA["models"][name])
    values.update(changes)
    return values


def write(tmp_path, values, name="arm.yaml"):
    path = tmp_path / name
    path.write_text(values if isinstance(values, str) else yaml.safe_dump(values))
    return str(path)


def test_there_are_twenty_two_models_and_each_loads():
    assert len(model_names()) == 22
    for name in model_names():
        model = load_model(name)
        assert model.name == name
        assert len(model.dh) == len(model.joint_limits) == len(model.joint_max_speed) == 6
        assert model.is_exact
        assert all(low < high for low, high in model.joint_limits)
        assert all(0.0 < speed < 6.0 for speed in model.joint_max_speed)
        assert model.sources and model.dh_confidence


def test_numbers_arrive_in_metres_and_radians():
    zu7 = load_model("zu7")
    assert [row.a for row in zu7.dh] == pytest.approx([0.0, 0.36, 0.3035, 0.0, 0.0, 0.0], abs=1e-15)
    assert [row.d for row in zu7.dh] == pytest.approx([0.12015, 0.0, 0.0, -0.11501, 0.1135, 0.107], abs=1e-15)
    assert zu7.joint_limits[1] == pytest.approx((math.radians(-85.0), math.radians(265.0)))
    assert zu7.joint_max_speed == pytest.approx((math.pi,) * 6)
    assert zu7.tcp_max_speed == 2.5
    assert zu7.joint_max_acceleration == (4.0 * math.pi,) * 6
    assert zu7.tcp_max_acceleration == 8.0


def test_a_speed_without_a_source_stays_unknown():
    assert load_model("c7").tcp_max_speed is None


@pytest.mark.parametrize("spelling", ["Zu7", "ZU 7", "zu-7", "zu_7", "JAKA Zu 7"])
def test_spelling_of_the_name_does_not_matter(spelling):
    assert load_model(spelling) == load_model("zu7")


@pytest.mark.parametrize("name, nearest", [("zu8", "zu"), ("minicobot", "'minicobo'"), ("", "zu"), ("pro77", "'pro7'")])
def test_an_unknown_name_is_answered_with_the_nearest_and_all(name, nearest):
    with pytest.raises(InvalidCommand) as caught:
        load_model(name)
    assert "nearest is " in str(caught.value) and nearest in str(caught.value)
    assert all(known in str(caught.value) for known in model_names())
    assert isinstance(caught.value, ValueError)


@pytest.mark.parametrize("name", model_names())
def test_every_entry_of_the_data_file_is_a_model_file(tmp_path, name):
    loaded = load_model_file(write(tmp_path, entry(name), name + ".yaml"))
    assert loaded.name == name
    assert loaded.dh == load_model(name).dh
    assert loaded.joint_limits == load_model(name).joint_limits


def test_a_model_file_may_set_everything(tmp_path):
    values = entry(tcp_max_speed_m_s=0.25, joint_max_acceleration_deg_s2=[90] * 6,
                   tcp_max_acceleration_m_s2=2, dh_confidence="calibrated", note="cell 4", sources=["laser tracker"])
    values["name"] = "my arm"
    model = load_model_file(write(tmp_path, values))
    assert (model.name, model.tcp_max_speed, model.tcp_max_acceleration) == ("my arm", 0.25, 2.0)
    assert model.joint_max_acceleration == pytest.approx((math.pi / 2,) * 6)
    assert (model.dh_confidence, model.note, model.sources) == ("calibrated", "cell 4", ("laser tracker",))


def test_a_calibrated_arm_keeps_its_own_numbers(tmp_path):
    values = entry()
    values["dh_standard"][0]["alpha"] = 1.571
    values["dh_standard"][1]["d"] = 0.2
    values["dh_standard"][3]["a"] = -0.3
    model = load_model_file(write(tmp_path, values))
    assert not model.is_exact and not model.has_closed_form
    assert (model.dh[0].alpha, model.dh[1].d, model.dh[3].a) == (1.571, 0.0002, -0.0003)
    assert (model.structural_dh[0].alpha, model.structural_dh[3].a) == (math.pi / 2, 0.0)


def without(key):
    values = entry()
    del values[key]
    return values


def changed(path, value):
    values = entry()
    place = values
    for step in path[:-1]:
        place = place[step]
    if value is None:
        del place[path[-1]]
    else:
        place[path[-1]] = value
    return values


NAN, INF = float("nan"), float("inf")
MALFORMED = {
    "family missing": (without("family"), "family"),
    "dh missing": (without("dh_standard"), "dh_standard"),
    "limits missing": (without("joint_limits_deg"), "joint_limits_deg"),
    "speeds missing": (without("joint_max_speed_deg_s"), "joint_max_speed_deg_s"),
    "family unknown": (entry(family="scara"), "scara"),
    "family of another type": (entry(family=["a"]), "family"),
    "structure of another family": (entry(family=arm_models.TWO_PARALLEL), "row 3"),
    "lengths in metres": (entry(dh_standard=[dict(row, a=row["a"] / 1e3, d=row["d"] / 1e3)
                                             for row in entry()["dh_standard"]]), "mm"),
    "a huge": (changed(["dh_standard", 1, "a"], 10 ** 400), "row 2: a"),
    "five rows": (changed(["dh_standard", 5], None), "dh_standard"),
    "dh no list": (entry(dh_standard="six rows"), "dh_standard"),
    "row no mapping": (changed(["dh_standard", 2], [1, 2, 3]), "row 3"),
    "row lacks a": (changed(["dh_standard", 2, "a"], None), "row 3"),
    "row with unknown key": (changed(["dh_standard", 2, "theta"], 0.0), "theta"),
    "a is NaN": (changed(["dh_standard", 1, "a"], NAN), "row 2: a"),
    "d is infinite": (changed(["dh_standard", 4, "d"], INF), "row 5: d"),
    "alpha is text": (changed(["dh_standard", 0, "alpha"], "90 deg"), "row 1: alpha"),
    "alpha in degrees": (changed(["dh_standard", 0, "alpha"], 90.0), "row 1"),
    "offset is true": (changed(["dh_standard", 0, "theta_offset"], True), "row 1: theta_offset"),
    "upper arm of no length": (changed(["dh_standard", 1, "a"], 0.0), "row 2"),
    "seven limits": (entry(joint_limits_deg=[[-360, 360]] * 7), "joint_limits_deg"),
    "limit of three": (changed(["joint_limits_deg", 3], [1, 2, 3]), "joint 4"),
    "limit NaN": (changed(["joint_limits_deg", 3], [NAN, 3]), "joint 4"),
    "limits reversed": (changed(["joint_limits_deg", 3], [265, -85]), "joint 4"),
    "limits equal": (changed(["joint_limits_deg", 3], [5, 5]), "joint 4"),
    "speed zero": (changed(["joint_max_speed_deg_s", 0], 0), "joint 1"),
    "speed negative": (changed(["joint_max_speed_deg_s", 5], -180), "joint 6"),
    "speed missing for one": (changed(["joint_max_speed_deg_s", 5], None), "joint_max_speed_deg_s"),
    "tcp speed zero": (entry(tcp_max_speed_m_s=0), "tcp_max_speed_m_s"),
    "tcp speed text": (entry(tcp_max_speed_m_s="fast"), "tcp_max_speed_m_s"),
    "acceleration short": (entry(joint_max_acceleration_deg_s2=[1, 2]), "joint_max_acceleration_deg_s2"),
    "tcp acceleration NaN": (entry(tcp_max_acceleration_m_s2=NAN), "tcp_max_acceleration_m_s2"),
    "sources no list": (entry(sources="me"), "sources"),
    "unknown key": (entry(joint_limit_deg=[[-1, 1]] * 6), "joint_limit_deg"),
    "the whole data file": (DATA, "family"),
    "a list": ([1, 2], "mapping"),
    "a word": ("zu7", "mapping"),
    "empty": ("", "mapping"),
    "no YAML": ("family: [", "no YAML"),
    "a tab": ("family:\n\t- x", "no YAML"),
    "python object": ("!!python/object/apply:os.getcwd []", "no YAML"),
}


@pytest.mark.parametrize("case", MALFORMED)
def test_a_malformed_file_gives_one_clear_error(tmp_path, case):
    values, word = MALFORMED[case]
    path = write(tmp_path, values)
    with pytest.raises(InvalidCommand) as caught:
        load_model_file(path)
    message = str(caught.value)
    assert word in message and message.count(path) == 1 and "\n" not in message


def test_files_that_cannot_be_read(tmp_path):
    with pytest.raises(JakaError, match="cannot be read"):
        load_model_file(str(tmp_path / "absent.yaml"))
    with pytest.raises(JakaError, match="cannot be read"):
        load_model_file(str(tmp_path))
    (tmp_path / "binary.yaml").write_bytes(b"\xff\xfe\x00\x80family")
    with pytest.raises(InvalidCommand):
        load_model_file(str(tmp_path / "binary.yaml"))


def test_every_confidence_word_is_explained():
    assert {values["dh_confidence"] for values in DATA["models"].values()} <= set(DATA["meta"]["dh_confidence"])


@pytest.mark.parametrize("beside, is_taken", [(1.9, True), (2.1, False)])
def test_a_calibrated_angle_may_be_two_degrees_beside_its_familys(tmp_path, beside, is_taken):
    values = entry()
    values["dh_standard"][3]["alpha"] += math.radians(beside)
    if is_taken:
        assert not load_model_file(write(tmp_path, values)).is_exact
    else:
        with pytest.raises(InvalidCommand, match="row 4"):
            load_model_file(write(tmp_path, values))


@pytest.mark.parametrize("key", ["name", "family", "dh_confidence", "note"])
@pytest.mark.parametrize("value", [True, 5, 1.5, ["a"]])
def test_what_must_be_a_text_and_is_none_is_refused_with_its_key(tmp_path, key, value):
    with pytest.raises(InvalidCommand, match="%s is .*; it must be a text" % key):
        load_model_file(write(tmp_path, changed([key], value)))


@pytest.mark.parametrize("text", ["name: 2001-99-99", "name: " + "[" * 20000, "name: 1%s" % ("0" * 5000), "name: [}"])
def test_a_model_file_that_is_no_yaml_is_refused_whatever_the_parser_raises(tmp_path, text):
    path = tmp_path / "arm.yaml"
    path.write_text(text)
    with pytest.raises(JakaError, match="model file .*: "):
        load_model_file(str(path))
