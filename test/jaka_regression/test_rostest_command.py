"""The command line of jaka_rostest: what it does not know is refused, and not left out."""
import pytest

from jaka_regression import rostest_command


@pytest.mark.parametrize("words", [
    ["--tolerence", "tight.yaml"], ["tight.yaml"], ["--limt", "5"], ["--gtest_output=xml:a.xml", "--strict"]])
def test_a_word_that_it_does_not_know_is_refused(words, capsys):
    with pytest.raises(SystemExit) as ended:
        rostest_command.main(["golden.mcap", *words])
    assert ended.value.code == 2 and words[-2 if words[0].startswith("--t") or words[0].startswith("--l") else -1] \
        in capsys.readouterr().err


def test_what_rostest_adds_is_taken(monkeypatch):
    class Rosunit:
        @staticmethod
        def unitrun(*_, **__):
            """Do nothing."""

    monkeypatch.setattr(rostest_command.importlib, "import_module", lambda _: Rosunit)
    assert rostest_command.main(["golden.mcap", "--gtest_output=xml:a.xml", "--time-scale", "1", "--text"]) == 0
