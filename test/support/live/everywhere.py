"""A signal handler that comes at each line of what it interrupts, as a signal may."""
import sys
import threading


def hangs(begin, timeout_s=3.0):
    """Return the lines, as text, at which a handler makes what it interrupts, in its own thread, wait for ever.

    Args:
        begin: Returns what is done and the handler, new ones each time: it is done once for each of its lines.
        timeout_s: Time after which it is taken to wait for ever.
    """
    found, number, is_reached = [], 0, True
    while is_reached:
        act, handler = begin()
        place = []
        thread = threading.Thread(target=_interrupted, args=(act, handler, number, place), daemon=True)
        thread.start()
        thread.join(timeout_s)
        if thread.is_alive():
            found += place
        is_reached, number = bool(place), number + 1
    return found


def _interrupted(act, handler, number, place):
    lines = []

    def trace(frame, event, argument):
        if event == "line":
            lines.append(frame)
            if len(lines) == number + 1:
                place.append("%s:%d" % (frame.f_code.co_filename, frame.f_lineno))
                handler()  # it is not traced itself
        return trace

    sys.settrace(trace)
    try:
        act()
    finally:
        sys.settrace(None)
