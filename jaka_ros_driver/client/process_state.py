"""What the kernel says of another process on this computer."""
import os


def waits_for_processor(process: int) -> bool:
    """A thread of the process could run and gets no time: silent, but neither stopped nor hung. False where unknown."""
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
