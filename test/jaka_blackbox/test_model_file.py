"""Evidence without a network: the model file that a parameter names is read before an accident, not believed."""
import json
import os
import threading
from types import SimpleNamespace

import pytest

from jaka_blackbox.evidence import Evidence

PATIENCE_S = 20.0
MODEL = """
family: three_parallel_offset_wrist
dh_standard:
""" + "- {a: 0.0, d: 121.1, alpha: 0.0}\n" * 6 + """
joint_limits_deg: [[-360, 360], [-85, 265], [-175, 175], [-85, 265], [-360, 360], [-360, 360]]
joint_max_speed_deg_s: [180, 180, 180, 180, 180, 180]
"""


def evidence_of(path):
    """Return the evidence once it has asked for parameters of which ``dh_file`` is this path; fail where that hangs."""
    evidence = Evidence("http://127.0.0.1:1/", "/box", "/jaka_driver", dict)
    parameters = {"jaka_driver": {"dh_file": path}}
    master = SimpleNamespace(call=lambda method, *arguments: json.loads(json.dumps(parameters)))
    thread = threading.Thread(target=evidence.refresh, args=(master,), daemon=True)
    thread.start()
    thread.join(PATIENCE_S)
    assert not thread.is_alive(), "it hangs"
    return evidence


def dh_file(evidence):
    """Return the model file in the evidence; None where there is none, and fail where it hangs."""
    found = []
    thread = threading.Thread(target=lambda: found.append(evidence.attachments()), daemon=True)
    thread.start()
    thread.join(PATIENCE_S)
    assert found, "it hangs"
    return {item.name: item.data for item in found[0]}.get("dh_file.yaml")


def test_a_model_file_is_in_the_evidence_as_it_was_before_the_accident(tmp_path):
    path = tmp_path / "my_zu5.yaml"
    path.write_text(MODEL)
    evidence = evidence_of(str(path))
    path.unlink()
    assert dh_file(evidence) == MODEL.encode()
    assert str(path) not in evidence.facts()["missing"]


@pytest.mark.parametrize("merged", ["*r", "[*r]"])
def test_a_model_file_with_merged_rows_is_in_the_evidence(tmp_path, merged):
    path = tmp_path / "my_zu5.yaml"
    row = "- {a: 0.0, d: 121.1, alpha: 0.0}\n"
    text = MODEL.replace(row * 6, row.replace("- ", "- &r ") + ("- {<<: %s, d: 5.0}\n" % merged) * 5)
    path.write_text(text)
    assert dh_file(evidence_of(str(path))) == text.encode()


@pytest.mark.parametrize("text", [
    "-----BEGIN OPENSSH PRIVATE KEY-----\nabc\n", "root:x:0:0:root:/root:/bin/bash\n", "password: secret\n", "", "7",
    "[]", "family: a\ndh_standard: 5\njoint_limits_deg: []\njoint_max_speed_deg_s: []\n", "[" * 5000,
    "\t: {", "a: 2020-99-99", "[&a 1, *b]", MODEL + "token: abc\n", MODEL + "? [a]\n: abc\n", "[" * 900000,
    MODEL + "#" * (1 << 20), MODEL.replace("{a: 0.0, d: 121.1, alpha: 0.0}", "{<<: secret}"),
    MODEL.replace("{a: 0.0, d: 121.1, alpha: 0.0}", "{<<: []}")])
def test_what_is_no_arm_model_is_named_and_not_copied(tmp_path, text):
    path = tmp_path / "file"
    path.write_text(text)
    evidence = evidence_of(str(path))
    assert dh_file(evidence) is None
    assert str(path) in evidence.facts()["missing"]


@pytest.mark.parametrize("path", ["/dev/zero", "/", "/nowhere/there", "a\0b", "\udc80", "x" * 5000])
def test_what_is_no_file_is_named(path):
    evidence = evidence_of(path)
    assert dh_file(evidence) is None
    assert "dh_file" in evidence.facts()["missing"]


def test_a_pipe_holds_up_nothing(tmp_path):
    os.mkfifo(str(tmp_path / "pipe"))
    evidence = evidence_of(str(tmp_path / "pipe"))
    assert dh_file(evidence) is None and "pipe" in evidence.facts()["missing"]


def test_no_file_is_read_at_an_accident(tmp_path):
    path = tmp_path / "my_zu5.yaml"
    path.write_text(MODEL)
    evidence = evidence_of(str(path))
    path.unlink()
    os.mkfifo(str(path))
    assert dh_file(evidence) == MODEL.encode()


def test_a_file_that_is_no_longer_named_is_not_in_the_evidence(tmp_path):
    path = tmp_path / "my_zu5.yaml"
    path.write_text(MODEL)
    evidence = evidence_of(str(path))
    evidence.refresh(SimpleNamespace(call=lambda method, *arguments: {}))
    assert dh_file(evidence) is None and "dh_file" not in evidence.facts()["missing"]
