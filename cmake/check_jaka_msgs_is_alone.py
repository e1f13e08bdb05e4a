"""The check for a second jaka_msgs in a workspace: argv is the folder of ours and the workspace's source folder.

The crawl is catkin's own: it honours CATKIN_IGNORE, follows links, and does not see our nested package.
"""
import os
import sys

from catkin_pkg.packages import find_packages

MESSAGE = """\
This workspace holds two packages named jaka_msgs:
  {ours}
  {other}
Their generated code would get mixed. Keep one of them:
  - that of jaka_ros_driver:  touch {other}/CATKIN_IGNORE
  - the other one:            export JAKA_MSGS_EXTERNAL=1
and build again from empty build and devel folders.
"""


def main() -> int:
    """Exit code: 0 alone, 1 another one is named on stderr."""
    ours, workspace_source = sys.argv[1:]
    for path, package in find_packages(workspace_source).items():
        if package.name == "jaka_msgs":
            sys.stderr.write(MESSAGE.format(ours=ours, other=os.path.join(workspace_source, path)))
            return 1
    return 0


sys.exit(main())
