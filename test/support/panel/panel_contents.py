"""An arm amid its work, for a panel of the tests: alarms, calls, motions, plots, settings, the data of a cell."""
import math
import time

from fake_panel import ARM

from jaka_ros_driver.kinematics.arm_models import load_model
from jaka_ros_driver.kinematics.forward import forward
from jaka_ros_driver.kinematics.rotations import rotation_vector_from_matrix

JOINTS = [-0.5, 1.25, -1.6, 1.9, 1.5, 0.4]
BEFORE = [0.3, 1.1, -1.2, 1.6, 1.5, 0.1]
MOTION_AGO_S = (82.0, 76.0)
_MOTION = "a trajectory"


def fill(panel):
    """Give a FakePanel an arm that rests at ``JOINTS`` after a motion, a collision and a recovery."""
    flange = forward(load_model("zu7"), JOINTS)
    pose = {"p": list(flange[9:]), "r": list(rotation_vector_from_matrix(flange[:9]))}
    panel.state.update(q=list(JOINTS), tool_id=1)
    panel.state["tool"].update(pose)
    panel.state["want"].update(q=list(JOINTS))
    now, clock = time.time(), time.monotonic()
    panel.first = [*_events(now), {"t": "moves", "moves": [{
        "n": 1, "s": clock - MOTION_AGO_S[0], "to": clock - MOTION_AGO_S[1], "owner": _MOTION, "lost": False}]}]
    begun = clock - MOTION_AGO_S[0]
    panel.history = lambda asked: _history(asked, begun)
    panel.cell, panel.cell_revision = _cell(now), 41
    panel.io["banks"]["cabinet"].update(di=[n in (0, 2, 5) for n in range(64)], do=[n == 3 for n in range(64)])
    frames = [{"p": [0.0] * 3, "r": [0.0] * 3}, {"p": [0.0, 0.0, 0.12], "r": [0.0] * 3}]
    held = {"tool": 1, "user_frame": 0, "tools": frames, "user_frames": frames, "collision_level": 2,
            "payload": {"mass": 1.5, "centre": [0.0, -0.02, 0.04]}}
    taught = {"p": [0.4, 0.1, 0.2], "r": [0.0, 0.0, 0.3], "residual": 0.0004}
    panel.answers.update({
        "settings": lambda asked: {"data": held},
        "logs": lambda asked: {"data": {"logs": [{"file": "pick_and_place.mcap", "size": 1 << 20, "wall": now}]}},
        "present_pose": lambda asked: {"data": {"q": list(JOINTS), "tool": pose, "flange": pose, "model": "zu7"}},
        "teach_user_frame": lambda asked: {"data": dict(taught, turn=0.005)},
        "teach_tool": lambda asked: {"data": dict(taught, worst=2, uncertainty=0.0003)},
        "cell_versions": lambda asked: {"data": {"versions": [
            {"revision": n, "saved": "2026-11-30T09:12:%02dZ" % n, "by": "Chrome, 1920×1080"} for n in (40, 39)]}}})


def _events(now):
    """Return the alarms, calls, diagnostics and outputs set by hand."""
    def call(n, ago, name, took, answer="ret: 1", ok=True):
        return {"n": n, "wall": now - ago, "service": ARM + "/" + name, "name": name, "type": "", "caller":
                "/jaka_panel", "request": "pose: [0.3, 1.1, -1.2, 1.6, 1.5, 0.1]", "answer": answer, "took": took,
                "ok": ok, "error": "" if ok else "a collision has stopped the arm"}
    return [
        {"t": "alarms", "alarms": [
            {"n": 1, "wall": now - 75, "until": now - 60, "level": "error", "code": "0x10F0005",
             "text": "joint 3: collision detected", "source": "controller"},
            {"n": 2, "wall": now - 60, "until": None, "level": "info", "code": None, "text": "recovered",
             "source": "driver"},
            {"n": 3, "wall": now - 40, "until": None, "level": "warning", "code": None,
             "text": "the status port was silent for 0.4 s", "source": "driver"},
            {"n": 4, "wall": now - 20, "until": None, "level": "info", "code": None,
             "text": "Chrome, 1920×1080 has control", "source": "panel"}]},
        {"t": "calls", "calls": [
            call(1, 90, "set_io", 0.004), call(2, 74, "joint_move", 0.012, answer="ret: 0", ok=False),
            call(3, 61, "recover", 2.1, answer="success: True")]},
        {"t": "diag", "wall": now, "status": [
            {"name": "controller link", "level": 0, "message": "up", "values": [
                ["address", "192.0.2.10:10001"], ["status frames", "125.0 Hz"], ["silent for", "0.004 s"]]},
            {"name": "controller state", "level": 1, "message": "the payload is not known", "values": [
                ["collision level", "2"]]},
            {"name": "motion guard", "level": 2, "message": "no workspace file is loaded", "values": []}]},
        {"t": "by_hand", "outputs": [{"bank": "cabinet", "signal": "digital", "index": 3, "value": True,
                                      "wall": now - 300, "by": "Chrome, 1920×1080"}]}]


def _cell(now):
    """Return the data of a cell with every kind of entry."""
    about = {"model": "zu7", "taken": now - 86400}
    frame = dict(about, p=[0.42, -0.1153, 0.0501], r=[0.0, 0.0, 0.3], number=1)
    points = [[0.42, -0.11, 0.05], [0.6, -0.05, 0.05], [0.4, 0.1, 0.05]]
    steps = [{"kind": "joint", "point": "above the tray", "speed": 0.5},
             {"kind": "line", "point": "at the tray", "speed": 0.1, "blend": 0.01},
             {"kind": "output", "signal": "digital", "index": 3, "bank": "cabinet", "value": True},
             {"kind": "wait", "s": 0.5}, {"kind": "arc", "via": "above the tray", "point": "P3", "speed": 0.2}]
    return {
        "points": {ARM: {"above the tray": dict(about, q=list(BEFORE)), "at the tray": dict(about, q=list(JOINTS)),
                         "P3": dict(about, q=[0.0, 1.5, -1.5, 1.5, 1.5, 0.0])}},
        "user_frames": {ARM: {"tray": dict(frame, residual=0.0004, points=points)}},
        "tool_frames": {ARM: {"gripper": dict(frame, residual=0.0006, uncertainty=0.0003)}},
        "payloads": {ARM: {"gripper, empty": {"tool": 1, "mass": 1.5, "centre": [0.0, -0.02, 0.04]}}},
        "io": {ARM: {"cabinet.di.2": {"label": "door closed"}, "cabinet.do.3": {"label": "gripper closes"}}},
        "lists": {ARM: {"from the tray": {"steps": steps}}},
        "layout": {"": {"page": {"values": {"view": "desk", "drawer": "240"}}}}}


def _history(asked, begun):
    """Return the history of the motion; ``begun``: its begin, s, by the server's clock."""
    now, step = time.monotonic(), (asked["to"] - asked["from"]) / asked["buckets"]
    times = [now + asked["from"] + n * step for n in range(int(asked["buckets"]))]
    whole = MOTION_AGO_S[0] - MOTION_AGO_S[1]
    shares = [min(max((at - begun) / whole, 0.0), 1.0) for at in times]
    smooth = [0.5 - 0.5 * math.cos(math.pi * share) for share in shares]
    speeds = [0.5 * math.pi / whole * math.sin(math.pi * share) for share in shares]
    scale = {"q": (1.0, smooth), "dq": (1.0, speeds), "e": (0.004, speeds)}[asked["what"]]
    rows = [[(start if asked["what"] == "q" else 0.0) + scale[0] * (end - start) * value for value in scale[1]]
            for start, end in zip(BEFORE, JOINTS)]
    return {"s": times, "last": [at + step for at in times], "min": rows, "max": rows}
