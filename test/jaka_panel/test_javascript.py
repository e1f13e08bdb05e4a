"""The page's JavaScript: its unit tests, the linter, the type checker, and that its libraries are the pinned ones."""
import json
import os
import re
import shutil
import subprocess
import sys

import pytest
from import_graph import ROOT

CHECK = ROOT / "test" / "jaka_panel" / "js" / "check.sh"
WEB = ROOT / "tools" / "jaka_panel" / "web"
MODULES = ROOT / "build" / "js" / "node_modules"
LONGEST = 600
LARGEST = 20
NODE = shutil.which("node", path=os.pathsep.join([os.environ.get("PATH", ""), str(ROOT / "build" / "venv" / "bin")]))


@pytest.mark.skipif(NODE is None, reason="needs node")
@pytest.mark.parametrize("name", ["unit", "lint", "types", "vendor"])
def test_check(name):
    if sys.version_info < (3, 9):
        pytest.skip("does not depend on the version of Python: once is enough")
    if name in ("lint", "types") and not MODULES.exists():
        pytest.skip("tools/dev setup installs what this needs, with npm")
    done = subprocess.run([str(CHECK), name], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=120)
    assert done.returncode == 0, done.stdout


def own_files():
    return [path for path in WEB.rglob("*") if path.is_file() and "vendor" not in path.parts]


def test_files_are_short_and_folders_are_small():
    assert len(own_files()) > 30
    for path in own_files():
        assert path.read_text(encoding="utf-8").count("\n") <= LONGEST, path
    folders = [path.parent for path in own_files()]
    assert max(folders.count(folder) for folder in folders) <= LARGEST


def test_nothing_of_the_page_comes_from_elsewhere_or_breaks_its_content_security_policy():
    page = (WEB / "index.html").read_text(encoding="utf-8")
    assert not re.search(r"<script(?![^>]*\bsrc=)|\bstyle=|\son\w+=|<style", page)
    for path in own_files():
        text = path.read_text(encoding="utf-8").replace("http://www.w3.org/2000/svg", "")
        assert not re.search(r"https?://|@import|\binnerHTML\b|\beval\(|new Function|javascript:", text), path


def test_every_library_has_its_licence_beside_it():
    libraries = [path for path in (WEB / "vendor").iterdir() if path.is_dir()]
    assert {path.name for path in libraries} == {"three", "uplot", "urdf-loader"}
    assert all(len((path / "LICENSE").read_text()) > 500 for path in libraries)


def test_what_checks_the_page_is_pinned():
    listed = json.loads((ROOT / "test" / "jaka_panel" / "js" / "package.json").read_text())["devDependencies"]
    assert all(re.fullmatch(r"\d+\.\d+\.\d+", version) for version in listed.values())
