"""The state of another process on this computer, from ``/proc``."""
import os


def waits_for_processor(process: int) -> bool:
    """Return whether a thread of the process is ready to run and gets no processor time; False where that is not known.

    Such a process is neither stopped nor hung.
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


def start_of(process: int) -> str:
    """Return the boot and the time of a process's start, "" where none runs.

    They tell it from all processes that had or will have the same id.
    """
    try:
        with open("/proc/%d/stat" % process) as file:
            fields = file.read().rpartition(")")[2].split()
        return "" if fields[0] in "ZX" else "%s %s" % (boot(), fields[19])
    except (OSError, IndexError):
        return ""


def boot() -> str:
    """Return what tells this start of the computer from all others; raise OSError where that is not known."""
    with open("/proc/sys/kernel/random/boot_id") as file:
        return file.read().strip()
