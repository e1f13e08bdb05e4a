"""The options: those that let others in warn of it; the token's file is its owner's alone."""
import os
import stat

import pytest

from jaka_panel.pages.access import Access
from jaka_panel.settings import Settings, WrongSettings, is_loopback, settings_from, token_from_file


def test_it_listens_on_loopback_with_a_new_token_each_time():
    one, other = settings_from([]), settings_from([])
    assert one.is_loopback and one.port == 8080 and not one.read_only and one.jog_fraction == 1.0
    assert one.token != other.token and len(one.token) >= 32
    assert one.address(8081, one.token) == "http://127.0.0.1:8081/#token=" + one.token


def test_others_are_told_an_address_that_leads_here_from_elsewhere():
    for host, here in (("0.0.0.0", "http://127.0.0.1:80/"), ("::", "http://[::1]:80/")):
        one = Settings(host=host)
        there = one.address_elsewhere(80)
        assert one.address(80) == here and there != here and "0.0.0.0" not in there and "[::]" not in there
    assert Settings(host="192.168.1.5").address_elsewhere(80) == "http://192.168.1.5:80/"


@pytest.mark.parametrize("host", ["0.0.0.0", "192.168.1.5", "::", "robot.example"])
def test_other_computers_are_let_in_only_when_it_is_said(host):
    with pytest.raises(WrongSettings, match="insecure-http.*everybody on the way"):
        settings_from(["--host", host])
    assert not settings_from(["--host", host, "--insecure-http"]).is_loopback
    assert settings_from(["--host", host, "--tls-cert", "c", "--tls-key", "k"]).scheme == "https"
    with pytest.raises(WrongSettings, match="belong together"):
        settings_from(["--host", host, "--tls-cert", "c"])


def test_behind_a_proxy_the_panel_has_the_proxys_name_and_listens_on_loopback():
    behind = settings_from(["--behind-tls", "panel.example:8443", "--allow-name", "other"])
    assert (behind.scheme, behind.names, behind.is_loopback) == ("https", ("other", "panel.example"), True)
    assert behind.address(8080, "x") == "https://panel.example:8443/#token=x"
    assert settings_from(["--behind-tls", "[::1]:1"]).names == ("::1",)
    for more in (["--tls-cert", "c", "--tls-key", "k"], ["--host", "0.0.0.0", "--insecure-http"]):
        with pytest.raises(WrongSettings, match="a proxy on this computer"):
            settings_from(["--behind-tls", "panel.example", *more])


def test_requests_through_a_proxy_have_its_name_and_its_scheme():
    access = Access(settings_from(["--behind-tls", "panel.example"]))

    def refusal(host, origin):
        return access.refusal({"Host": host, "Origin": origin}, True)
    assert refusal("panel.example", "https://panel.example") is None
    for host, origin in (("panel.example", "http://panel.example"), ("panel.example", "https://evil.example"),
                         ("evil.example", "https://evil.example"), ("panel.example:1", "https://panel.example"),
                         ("127.0.0.1:8080", "https://panel.example"), ("127.0.0.1:8080", "http://127.0.0.1:8080")):
        assert refusal(host, origin) is not None, (host, origin)


def test_the_cells_data_are_kept_below_ros_home_unless_a_file_is_named(monkeypatch):
    monkeypatch.setenv("ROS_HOME", "/ros")
    assert settings_from([]).cell_data == "/ros/jaka_cell/cell.json"
    monkeypatch.setenv("ROS_HOME", "")
    assert settings_from([]).cell_data == os.path.expanduser("~/.ros/jaka_cell/cell.json")
    assert settings_from(["--cell-data", "x.json"]).cell_data == "x.json"


def test_what_is_loopback():
    assert all(map(is_loopback, ("127.0.0.1", "127.8.8.8", "::1", "localhost")))
    assert not any(map(is_loopback, ("0.0.0.0", "::", "10.0.0.1", "localhost.evil.example", "127.0.0.1.evil", "")))


def test_the_tokens_file_is_made_kept_and_its_owners_alone(tmp_path):
    path = str(tmp_path / "token")
    token = token_from_file(path)
    assert stat.S_IMODE(os.stat(path).st_mode) == 0o600 and token_from_file(path) == token
    os.chmod(path, 0o640)
    with pytest.raises(WrongSettings, match="can be read by others"):
        token_from_file(path)
    os.chmod(path, 0o600)
    for content in ("short", "with blanks in it, and long enough", "ÄÄÄÄÄÄÄÄÄÄÄÄÄÄÄÄÄÄÄÄ"):
        (tmp_path / "token").write_text(content, encoding="utf-8")
        with pytest.raises(WrongSettings):
            token_from_file(path)
    with pytest.raises(WrongSettings):
        token_from_file(str(tmp_path / "no folder" / "token"))


@pytest.mark.parametrize("words", [["--port", "x"], ["--port", "70000"], ["--pages", "0"], ["--max-jog-speed", "0"],
                                   ["--max-jog-speed", "nan"], ["--unknown"], ["--host", ""],
                                   ["--behind-tls", ""], ["--behind-tls", "https://a"], ["--behind-tls", "A b"],
                                   ["--tls-cert", ""], ["--tls-key", " "], ["--token-file", ""], ["--cell-data", ""]])
def test_wrong_options_end_it(words, capsys):
    with pytest.raises(SystemExit) as end:
        settings_from(words)
    assert end.value.code == 2 and words[0] in capsys.readouterr().err
