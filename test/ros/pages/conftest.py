"""A shell in an empty folder, like that of a reader who types the commands of a page."""
import os

import pytest
from page_commands import Shell


@pytest.fixture
def shell(ros_master, root, tmp_path):
    (tmp_path / "build").symlink_to(root / "build")
    one = Shell(tmp_path, dict(os.environ), ". build/devel/setup.bash")
    yield one
    one.close()
