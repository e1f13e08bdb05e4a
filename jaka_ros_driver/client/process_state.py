"""The state of another process on this computer, from ``/proc``."""
import os


def waits_for_processor(process: int) -> bool:
    """True where a thread of the process is ready to run and gets no processor time: the process is neither stopped nor
    hung. False where that is not known.
    """
    try:
        threads = os.listdir("/proc/%d/task" % process)
    except OSError:
        return False
    for thread in threads:
        try:
            with open("/proc/%d/task/%s/stat" % (process, thread)) as file:
                if file.read().rpartition(")")[2].split()[0] == "R":
                    return True
        except (OSError, IndexError):
            continue
    return False
