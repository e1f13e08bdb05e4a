"""A profiler that records which files of a package call which, and draws that as a tree, as in docs/architecture.md."""
import os
import sys
import threading


class CallTracer:
    """The record of the calls of a package's functions, in the threads that follow it, while it is on.

    Attributes:
        calls: For each thread id: for each (calling file, called file) the functions that were called, with the line of
            their definition. The calling file is "" where no file of the package is further up.
        sequence: For each thread id the calls, (file, function), in their order.
    """

    def __init__(self, package):
        """Prepare; ``package`` is the package's folder."""
        self._package = str(package) + os.sep
        self._files = {}  # by the code's own name of its file
        self._is_on = False
        self.calls = {}
        self.sequence = {}

    def __enter__(self):
        self._is_on = True
        return self

    def __exit__(self, *_):
        self._is_on = False

    def follow(self):
        """Trace the calls of this thread from now on."""
        sys.setprofile(self._note)

    def follow_here_and_in_new_threads(self):
        """Trace the calls of this thread, and of all threads that ``threading`` starts, from now on."""
        threading.setprofile(self._note)
        self.follow()

    @staticmethod
    def follow_no_more():
        """End what the two methods above have begun."""
        threading.setprofile(None)
        sys.setprofile(None)

    @property
    def files(self):
        """The set of all files that were called, or have called others."""
        return {name for calls in self.calls.values() for edge in calls for name in edge if name}

    def _file_of(self, code):
        """Return the file relative to the package; "" where it is none of it."""
        try:
            return self._files[code.co_filename]
        except KeyError:
            path = os.path.abspath(code.co_filename)
            name = path[len(self._package):].replace(os.sep, "/") if path.startswith(self._package) else ""
            self._files[code.co_filename] = name
            return name

    def _note(self, frame, event, _argument):
        if not self._is_on or event != "call" or frame.f_code.co_name == "<module>":
            return
        file = self._file_of(frame.f_code)
        if not file:
            return
        caller, above = "", frame.f_back
        while above is not None and not caller:
            caller, above = self._file_of(above.f_code), above.f_back
        thread, name = threading.get_ident(), frame.f_code.co_name
        self.calls.setdefault(thread, {}).setdefault((caller, file), {})[name] = frame.f_code.co_firstlineno
        self.sequence.setdefault(thread, []).append((file, name))


def tree(calls, most_names=3):
    """Draw the calls of one thread: each file once, indented below the nearest file that calls it.

    The same calls are drawn the same, in whatever order they were made: files stand by their names, functions in the
    order of their definitions.

    Args:
        calls: As ``CallTracer.calls`` has them for a thread.
        most_names: At most so many of the called functions stand behind a file.

    Returns:
        The lines of the drawing, without a line end.
    """
    called = {file for caller, file in calls if caller != file}
    below = {}
    for caller, file in calls:
        if caller != file:
            below.setdefault(caller, []).append(file)
    roots = sorted(dict.fromkeys(below.pop("", []) + [caller for caller in below if caller not in called]))
    depth = dict.fromkeys(roots, 0)
    parent = dict.fromkeys(roots, "")
    queue = list(depth)
    for file in queue:  # it grows: the nearest caller is met first
        for other in sorted(below.get(file, ())):
            if other not in depth:
                depth[other], parent[other] = depth[file] + 1, file
                queue.append(other)
    lines = []

    def draw(file):
        called_here = calls.get((parent[file], file), {})
        names = [name for name in sorted(called_here, key=lambda name: (called_here[name], name))
                 if name[0] not in "<_"][:most_names]
        lines.append("%s%s%s" % ("  " * depth[file], file, ": " + ", ".join(names) if names else ""))
        for other in (other for other in queue if parent[other] == file):
            draw(other)

    for root in roots:
        draw(root)
    return lines


def drawn(lines):
    """Read a drawing back: for each (calling file, called file) the names of functions that stand there."""
    found, above = {}, []
    for line in lines:
        text = line.strip()
        file, _, names = text.partition(": ")
        depth = (len(line) - len(line.lstrip())) // 2
        del above[depth:]
        found[above[-1] if above else "", file] = [name for name in names.split(", ") if name]
        above.append(file)
    return found


def faults_of(lines, calls):
    """Return what a drawing shows that is not in these calls, and which files of theirs it lacks."""
    shown = drawn(lines)
    callers = {caller for caller, _ in calls}
    faults = []
    for (caller, file), names in shown.items():
        seen = calls.get((caller, file))
        if seen is None and not (not caller and file in callers):
            faults.append("%s does not call %s" % (caller or "nobody", file))
        faults += ["%s does not call %s of %s" % (caller or "nobody", name, file)
                   for name in names if name not in (seen or ())]
    files = {name for edge in calls for name in edge if name}
    return faults + ["%s is not shown" % file for file in sorted(files - {file for _, file in shown})]
