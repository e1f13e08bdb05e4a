"""A session at the operator port: each line of stdin is a JSON request, each line of stdout the answer."""
import json
import signal
import sys
from typing import List, Optional

from jaka_ros_driver.errors import JakaError
from jaka_ros_driver.simulation.server.event_loop import ask_operator_port


def main(argv: Optional[List[str]] = None) -> int:
    """Serve stdin until it ends; ``argv`` is the number of the operator port.

    Returns 0 done, 1 the simulated controller has gone, 2 wrong usage.
    """
    arguments = sys.argv[1:] if argv is None else argv
    if len(arguments) != 1 or not arguments[0].isdigit():
        print("usage: operator_session PORT", file=sys.stderr)
        return 2
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # it may be inherited as ignored
    print(json.dumps({"ok": True, "port": int(arguments[0])}), flush=True)
    for line in sys.stdin:
        try:
            request = json.loads(line)
            answer = ask_operator_port(int(arguments[0]), request)
        except ValueError:
            answer = {"ok": False, "error": "not JSON: %s" % line.strip()}
        except JakaError as error:
            print(json.dumps({"ok": False, "error": str(error)}), flush=True)
            return 1
        print(json.dumps(answer), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
