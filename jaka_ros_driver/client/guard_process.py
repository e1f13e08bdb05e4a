"""The guard: a process beside the driver that stops the arm when the driver dies or freezes while it moves the arm.

Every 20 ms the driver reports, on standard input, whether it moves the arm, or that it ends in good order. The guard
answers on standard output. When the pipe closes without a farewell, or no message comes for 0.25 s (1 s where the host
is so busy that the driver gets no processor time), and the driver was moving the arm, the guard takes the command port
over, or shares it (docs/controller-protocol.md section 1), and stops the arm, as stopping.py describes.

What asks every process of a service, a session or a computer to end (SIGTERM, SIGINT, SIGHUP) does not end the guard:
a driver that hangs would be left without one. The guard ends as soon as its driver has, and the arm is stopped.

Some controllers turn a second client away. Such a controller cannot be reached while a frozen driver holds the
connection; then the guard kills the driver's process.

The guard needs this computer, its network and the controller. Where one of these fails, only the controller's own
safety functions stop the arm.
"""
import argparse
import signal
import sys
from typing import List, Optional

from jaka_ros_driver.background_log import StandardErrorLog
from jaka_ros_driver.client.arm_stopper import ArmStopper
from jaka_ros_driver.client.driver_pipe import OUTLIVED, DriverPipe, LogText

_LOG_TIMEOUT_S = 0.5
"""Longest wait, s, at the end for a log that nobody reads."""


def watch(pipe: DriverPipe, stopper: ArmStopper, log: LogText) -> None:
    """Watch the driver until it ends, and stop the arm where needed."""
    while True:
        pipe.wait_for_silence()
        if pipe.is_moving and not pipe.has_left:
            log("the driver %s while the arm moves, stopping the arm" % ("has died" if pipe.is_closed else "is silent"))
            pipe.is_moving = False  # until the driver reports again that it moves the arm
            stopper.stop(pipe)
        elif pipe.is_over:
            stopper.forget(pipe)
            return


def main(argv: Optional[List[str]] = None) -> int:
    """Run the guard process."""
    parser = argparse.ArgumentParser(prog="jaka_guard", description="Stops the arm when its driver dies or freezes.")
    parser.add_argument("--host", required=True, help="address of the controller")
    parser.add_argument("--port", required=True, type=int, help="its command port")
    parser.add_argument("--status-port", required=True, type=int, help="its status port")
    parser.add_argument("--driver", required=True, type=int, help="process id of the driver")
    parser.add_argument("--moving", action="store_true", help="the driver moves the arm already")
    args = parser.parse_args(argv)
    for number in OUTLIVED:
        signal.signal(number, signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, OUTLIVED)
    log = StandardErrorLog("guard")
    pipe = DriverPipe(sys.stdin.fileno(), sys.stdout.fileno(), args.driver, args.moving)
    watch(pipe, ArmStopper(args.host, args.port, args.status_port, log.write), log.write)
    log.close(_LOG_TIMEOUT_S)
    return 0


if __name__ == "__main__":
    sys.exit(main())
