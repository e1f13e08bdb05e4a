"""The conversion of one file as a task among many."""
from ..operations.convert import Job, convert_file
from .tasks import LogResult, LogTask


def task_of(job: Job) -> LogTask:
    """Return a job as a task for ``convert_task``."""
    return LogTask(job.source, job)


def convert_task(task: LogTask) -> LogResult:
    """Convert the file; ``value`` is the ``WriteResult``."""
    result = convert_file(task.settings)
    return LogResult(task.path, size=result.bytes_read, messages=result.messages, value=result)
