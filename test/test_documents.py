"""The pages: each is in the index, every link leads somewhere, so does every citation in the code; one version."""
import ast
import re
from xml.etree import ElementTree

import pytest
import yaml
from import_graph import ROOT

DOCS = ROOT / "docs"
PAGES = sorted(DOCS.rglob("*.md")) + [ROOT / "README.md", ROOT / "CONTRIBUTING.md"]
CITED = {"controller protocol": "controller-protocol.md", "sdk client": "sdk-client.md", "interface": "interface.md"}
"""Forms of citation in comments and pages, by the subject or by the page: ``controller protocol 4.3``,
``docs/controller-protocol.md section 4.3``."""
LINK = re.compile(r"\[[^\]\n]*\]\(([^)\s]+)\)")
PATH = re.compile(r"`((?:docs|jaka_msgs|jaka_ros_driver|launch|test|tools|\.ci)/[\w./*-]*)`")
PAGE_NAME = re.compile(r"`([\w-]+\.md)`")
SECTION = r"\d+(?:\.\d+)*"
CITATION = re.compile(r"\b(controller[ -]protocol|SDK[ -]client|interface)(?: document|\.md)?,? (?:sections? )?"
                      r"(%s(?:(?:, | to | and )%s)*)" % (SECTION, SECTION), re.IGNORECASE)
LONGEST_CELL = 120
"""Characters of a table's cell."""
ELSEWHERE = {"docs/en/guide/errinfo.md", "errinfo.md"}  # of the maker's own documentation


def text_of(page):
    return page.read_text(encoding="utf-8")


def without_code(text):
    return re.sub(r"```.*?```", "", text, flags=re.DOTALL)


def anchors(page):
    """Return the anchors of a page's headings, as GitHub makes them."""
    headings = re.findall(r"^#+ (.+)$", without_code(text_of(page)), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name if page.parent != ROOT else "/" + page.name)
def test_every_link_and_every_path_leads_somewhere(page):
    text = without_code(text_of(page))
    wrong = []
    for target in LINK.findall(text):
        if target.startswith(("https://", "http://")):
            continue
        path, _, anchor = target.partition("#")
        goal = (page.parent / path).resolve() if path else page
        if not goal.exists() or (anchor and anchor not in anchors(goal)):
            wrong.append(target)
    for name in PATH.findall(text):
        if "NAME" not in name and not list(ROOT.glob(name.rstrip("/"))):
            wrong.append(name)
    wrong += [name for name in PAGE_NAME.findall(text) if not any((folder / name).exists() for folder in (DOCS, ROOT))]
    assert not set(wrong) - ELSEWHERE


def long_cells(text):
    """Return the cells of tables that are longer than a reader takes in at a glance: (number of the line, cell)."""
    blank = re.sub(r"```.*?```", lambda block: "\n" * block.group().count("\n"), text, flags=re.DOTALL)
    return [(number, cell.strip()) for number, line in enumerate(blank.splitlines(), 1) if line.lstrip().startswith("|")
            for cell in re.split(r"(?<!\\)\|", line) if len(cell.strip()) > LONGEST_CELL]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name if page.parent != ROOT else "/" + page.name)
def test_no_cell_of_a_table_holds_a_paragraph(page):
    assert not long_cells(text_of(page)), "make it prose or a list"


@pytest.mark.parametrize("text, found", [
    ("| a | %s |\n" % ("x" * 121), [(1, "x" * 121)]),
    ("text\n\n| `a\\|b` | %s | c |\n" % ("y" * 130), [(3, "y" * 130)]),
    ("```\n| %s |\n```\n| %s |\n" % ("z" * 130, "z" * 121), [(4, "z" * 121)]),
    ("| %s |\n|---|\n%s\n" % ("x" * 120, "p" * 500), []),
])
def test_a_long_cell_is_noticed(text, found):
    assert long_cells(text) == found


LONGEST_SENTENCE = 30
"""Words; what stands in backquotes is one, and a colon or semicolon ends a sentence as a full stop does."""
LONG_SENTENCES = {
    "CONTRIBUTING.md": 3, "docs/architecture.md": 5, "docs/audit.md": 4, "docs/controller-protocol.md": 11,
    "docs/fleet.md": 1, "docs/fleet_regression.md": 3, "docs/foxglove.md": 1, "docs/gripper.md": 1,
    "docs/interface.md": 3, "docs/kinematics.md": 1, "docs/migration.md": 2, "docs/motion_guard.md": 7,
    "docs/panel.md": 2, "docs/panel_page.md": 4, "docs/parameters.md": 1, "docs/regression_testing.md": 7,
    "docs/ros-interface.md": 4, "docs/safety.md": 8, "docs/sdk-client.md": 2, "docs/security.md": 1,
    "docs/simulated_motion.md": 3, "docs/state_logs.md": 7, "docs/trajectories.md": 4, "docs/velocity_jog.md": 2}
"""Most longer sentences of a page, by its path; others have none. The numbers only fall."""


def long_sentences(text):
    """Return sentences outside code and tables that a reader has to begin twice."""
    prose = re.sub(r"```.*?```|^\|.*?$", "\n\n", text, flags=re.DOTALL | re.MULTILINE)
    prose = re.sub(r"`[^`\n]*`", "x", re.sub(r"<!--.*?-->|\]\([^)\s]*\)", " ", prose, flags=re.DOTALL))
    ends = r"(?<=[.:;!?])[)*]*\s|\n\s*\n|^\s*(?:[-*]|\d+\.)\s|^#+ .*$"
    sentences = [sentence.split() for sentence in re.split(ends, prose, flags=re.MULTILINE)]
    return [" ".join(words) for words in sentences if len(words) > LONGEST_SENTENCE]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name if page.parent != ROOT else "/" + page.name)
def test_sentences_are_short(page):
    found, name = long_sentences(text_of(page)), page.relative_to(ROOT).as_posix()
    assert len(found) <= LONG_SENTENCES.get(name, 0), "\n".join(found)


@pytest.mark.parametrize("text, count", [
    ("%s.\n" % " ".join(["word"] * 31), 1), ("%s.\n" % " ".join(["word"] * 30), 0),
    ("- %s:\n- %s.\n" % (" ".join(["word"] * 20), " ".join(["word"] * 20)), 0),
    ("Say\n%s\nof it: then %s.\n" % ("word " * 20, "`a b c` " * 31), 1), ("`%s` is one.\n" % ("a " * 40), 0),
    ("| %s |\n" % ("word " * 40), 0),
    ("```\n%s\n```\n" % ("word " * 40), 0)])
def test_a_long_sentence_is_noticed(text, count):
    assert len(long_sentences(text)) == count


def test_no_page_that_is_gone_may_have_long_sentences():
    assert set(LONG_SENTENCES) <= {page.relative_to(ROOT).as_posix() for page in PAGES}


def test_every_page_is_in_the_index():
    index = set(LINK.findall(text_of(DOCS / "README.md")))
    others = {path.relative_to(DOCS).as_posix() for path in DOCS.rglob("*") if path.suffix in (".md", ".py")}
    assert not others - index - {"README.md"}


def sections(page):
    """Return numbers of the sections, and of the points of a numbered list below them: 1.7 is point 7 of section 1."""
    found, section = set(), ""
    for line in without_code(text_of(page)).splitlines():
        heading = re.match(r"#+ (%s)\.? " % SECTION, line)
        if heading:
            section = heading.group(1)
            found.add(section)
        point = re.match(r"(\d+)\. ", line)
        if point and section:
            found.add("%s.%s" % (section, point.group(1)))
    return found


def flat(text):
    """Return the text without line ends, comment signs and quotes between two parts of a string, where a citation may
    be broken."""
    return re.sub(r"[\"\s#]+", " ", text)


def citations():
    for folder in ("jaka_ros_driver", "jaka_msgs", "test", "tools", "docs"):
        for path in sorted((ROOT / folder).rglob("*")):
            if path.suffix in (".srv", ".msg", ".md", ".yaml"):  # test_citations.py sees to the code
                for what, numbers in CITATION.findall(flat(text_of(path))):
                    for number in re.findall(SECTION, numbers):
                        yield path.relative_to(ROOT).as_posix(), what.lower().replace("-", " "), number


def test_every_citation_leads_to_a_section():
    known = {what: sections(DOCS / page) for what, page in CITED.items()}
    found = list(citations())
    assert len(found) > 20
    assert not [one for one in found if one[2] not in known[one[1]]]


def test_every_row_of_the_interface_document_that_a_type_cites_is_there():
    rows = text_of(DOCS / CITED["interface"])
    cited = [(path.name, name) for path in sorted((ROOT / "jaka_msgs").rglob("*.*"))
             if path.suffix in (".msg", ".srv")
             for name in re.findall(r"interface document V2\.\d, (?:topic )?(\w+)\)", text_of(path))]
    assert len(cited) > 8
    assert not [one for one in cited if "`~%s`" % one[1] not in rows]


def test_every_page_that_a_launch_file_names_is_there():
    named = {(path.relative_to(ROOT).as_posix(), name) for folder in ("jaka_ros_driver", "tools", "test", "launch")
             for path in (ROOT / folder).rglob("*") if path.suffix in (".launch", ".test")
             for name in re.findall(r"\bdocs/[\w/-]+\.(?:md|py)\b", text_of(path))}
    assert named and not [one for one in named if one[1] not in ELSEWHERE and not (ROOT / one[1]).exists()]


def test_examples_are_python_3_8():
    for path in (DOCS / "examples").glob("*.py"):
        ast.parse(text_of(path), feature_version=(3, 8))


def test_the_sections_of_the_command_table_are_those_of_the_pages():
    text = text_of(DOCS / "simulation.md").partition("<!-- commands -->")[2].partition("<!-- end -->")[0]
    cells = [line.split("|")[2].strip() for line in text.splitlines() if line.startswith("| `")]
    assert len(cells) > 100
    protocol, sdk = sections(DOCS / CITED["controller protocol"]), sections(DOCS / CITED["sdk client"])
    for cell in cells:
        number = re.search(SECTION, cell)
        if number:
            assert number.group() in (sdk if cell.lower().startswith("sdk") else protocol), cell


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name if page.parent != ROOT else "/" + page.name)
def test_pages_speak_of_the_project_only(page):
    strangers = re.search(r"\.\./shared|today's code|\bissue \d+|\bthis session\b", text_of(page))
    assert not strangers, strangers.group()


# ---- one version ----

def version():
    return ElementTree.parse(str(ROOT / "package.xml")).findtext("version")


def test_the_newest_closed_version_of_the_changelog_is_that_of_the_packages():
    titles = re.findall(r"^(.+)\n-+$", text_of(ROOT / "CHANGELOG.rst"), re.MULTILINE)
    assert titles[0] == "Forthcoming"
    assert re.match(r"%s \(\d{4}-\d\d-\d\d\)$" % re.escape(version()), titles[1])
    assert ElementTree.parse(str(ROOT / "jaka_msgs" / "package.xml")).findtext("version") == version()
    tree = ast.parse(text_of(ROOT / "jaka_ros_driver" / "__init__.py"))
    assert [ast.literal_eval(node.value) for node in tree.body if isinstance(node, ast.Assign)
            and getattr(node.targets[0], "id", "") == "__version__"] == [version()]


def test_the_log_tools_have_the_same_version():
    assert pytest.importorskip("jaka_bag").__version__ == version()


# ---- the page for contributors ----

def hooks():
    (repo,) = yaml.safe_load(text_of(ROOT / ".pre-commit-config.yaml"))["repos"]
    assert repo["repo"] == "local", "a hook of another place would have versions of its own"
    return {hook["id"]: hook for hook in repo["hooks"]}


def test_hooks_run_the_programs_of_ci_in_the_versions_of_requirements_txt():
    ci, requirements = text_of(ROOT / ".ci" / "run"), text_of(ROOT / "requirements.txt")
    assert set(hooks()) == {"ruff", "mypy", "catkin-lint"}
    for name, hook in hooks().items():
        assert hook["language"] == "system" and "additional_dependencies" not in hook
        if name != "catkin-lint":
            assert hook["entry"] in ci and re.search("^%s[=<>]" % name, requirements, re.MULTILINE)
    tested = text_of(ROOT / "test" / "packaging" / "test_spaces.py")
    lint, strict = hooks()["catkin-lint"]["entry"], "catkin_lint --quiet --strict --offline "
    assert strict in tested and lint.startswith(strict)
    assert set(re.findall(r'"(\w+)",? +# ', tested)) == set(re.findall(r"--ignore (\w+)", lint))


@pytest.mark.parametrize("path", [".ci/run", "tools/dev", "pyproject.toml", "setup.cfg", "requirements.txt",
                                  "test/conftest.py"])
def test_nothing_that_failed_is_tried_again(path):
    again = re.search(r"last.?failed|--lf\b|--failed-first|--ff\b|rerun|flaky|retry|retries|second.try",
                      text_of(ROOT / path), re.IGNORECASE)
    assert not again, "%s: %r would make a test that fails by chance pass" % (path, again.group())


def test_the_checks_of_the_page_are_the_hooks():
    # Whether the other commands of contributors run, test/ros/pages/test_written_commands.py checks.
    page = text_of(ROOT / "CONTRIBUTING.md")
    assert all("\n%s\n" % hook["entry"] in page for hook in hooks().values())
