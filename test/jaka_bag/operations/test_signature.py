"""``record --sign`` and ``verify``: every changed byte is found and named, and who signed."""
import random
import sys

import pytest
from log_samples import state_log, write

from jaka_bag.cli.main import main
from jaka_bag.containers.registry import read_index
from jaka_bag.operations.signature import sign, verify

serialization = pytest.importorskip("cryptography.hazmat.primitives.serialization")
ed25519 = pytest.importorskip("cryptography.hazmat.primitives.asymmetric.ed25519")


def key_pair(folder, name):
    key = ed25519.Ed25519PrivateKey.generate()
    private, public = folder / (name + ".pem"), folder / (name + "_public.pem")
    private.write_bytes(key.private_bytes(serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8,
                                          serialization.NoEncryption()))
    public.write_bytes(key.public_key().public_bytes(serialization.Encoding.PEM,
                                                     serialization.PublicFormat.SubjectPublicKeyInfo))
    return key, private, public


@pytest.fixture(params=["mcap", "bag"])
def signed(request, tmp_path):
    path = write(tmp_path / ("log." + request.param), state_log(2.0))
    key, _, _ = key_pair(tmp_path, "signer")
    sign(path, key)
    return path


def test_an_unchanged_log_verifies(signed, capsys):
    assert main(["verify", str(signed)]) == 0
    assert "unchanged since it was signed" in capsys.readouterr().out


def test_every_changed_byte_is_found_and_its_place_is_named(signed):
    raw = signed.read_bytes()
    chance = random.Random(1)
    for at in [0, 9, len(raw) - 1, len(raw) - 20] + [chance.randrange(len(raw)) for _ in range(60)]:
        signed.write_bytes(raw[:at] + bytes([raw[at] ^ 1 << chance.randrange(8)]) + raw[at + 1:])
        (problem,) = verify(signed).problems
        first, last = (int(word) for word in problem.split(" were changed")[0].replace("bytes ", "").split(" to "))
        assert first <= at <= last
    signed.write_bytes(raw)
    assert not verify(signed).problems


def test_what_was_changed_is_named_by_its_record(tmp_path):
    path = write(tmp_path / "log.mcap", state_log(2.0))
    sign(path, key_pair(tmp_path, "signer")[0])
    chunk = read_index(path).chunks[1]
    raw = bytearray(path.read_bytes())
    raw[chunk.position + 100] ^= 1
    path.write_bytes(bytes(raw))
    (problem,) = verify(path).problems
    assert "chunk of the messages from 1700000000." in problem and "bytes %d to" % chunk.position in problem


def test_cut_off_longer_or_unsigned_logs_are_told(signed, capsys):
    raw = signed.read_bytes()
    signed.write_bytes(raw[:-100])
    assert any("signed were %d" % len(raw) in problem for problem in verify(signed).problems)
    signed.write_bytes(raw + b"x")
    assert any("not signed" in problem for problem in verify(signed).problems)
    (signed.parent / (signed.name + ".sig")).unlink()
    assert main(["verify", str(signed)]) == 1
    assert "there is no signature" in capsys.readouterr().out


def test_a_signature_that_was_changed_or_made_by_another_is_told(signed, tmp_path, capsys):
    _, _, other_public = key_pair(tmp_path, "other")
    assert main(["verify", str(signed), "--key", str(other_public)]) == 1
    assert "another key" in capsys.readouterr().out
    signature = signed.parent / (signed.name + ".sig")
    text = signature.read_text()
    signature.write_text(text.replace('"signed_at": "2', '"signed_at": "3'))
    assert any("itself was changed" in problem for problem in verify(signed).problems)
    for broken in ("", "{}", "[]", text.replace("jaka_bag signature 1", "x"), text.replace('"pieces"', '"bits"')):
        signature.write_text(broken)
        assert main(["verify", str(signed)]) == 1
        assert "no signature that is understood" in capsys.readouterr().out


def test_the_signers_key_is_recognised_and_wrong_keys_are_refused(tmp_path, capsys):
    path = write(tmp_path / "log.mcap", state_log(0.5))
    key, private, public = key_pair(tmp_path, "signer")
    sign(path, key)
    assert main(["verify", str(path), "--key", str(public)]) == 0
    assert "only --key" not in capsys.readouterr().out
    assert main(["verify", str(path), "--key", str(private)]) == 2
    assert main(["verify", str(path), "--key", str(tmp_path / "none.pem")]) == 2
    assert main(["record", "-a", "--sign", str(public)]) == 2
    assert "no private key" in capsys.readouterr().err


def test_without_the_package_the_option_says_so(monkeypatch, tmp_path, capsys):
    for name in list(sys.modules):
        if name.split(".")[0] == "cryptography":
            monkeypatch.setitem(sys.modules, name, None)
    assert main(["record", "-a", "--sign", str(tmp_path / "key.pem")]) == 1
    assert "pip install cryptography" in capsys.readouterr().err
