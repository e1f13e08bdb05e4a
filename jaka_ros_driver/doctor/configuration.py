"""The checks of what a driver is told: its parameters, its folders, another driver of this computer."""
import contextlib

from jaka_ros_driver.client.runtime_file import RuntimeFile
from jaka_ros_driver.doctor.computer import look_at_folder
from jaka_ros_driver.doctor.findings import Examination, Observation, fault, good, skipped
from jaka_ros_driver.doctor.subject import ExaminedSystem


def parameters(subject: ExaminedSystem) -> Observation:
    """Check the parameters as the driver does at its start."""
    if subject.wrong:
        return fault(subject.wrong, "the driver does not start (exit code 2)", "correct what is named")
    config = subject.config
    return good("%s: model %s, controller %s" % (
        subject.source, config.arm_model().name, config.ip if subject.has_controller else "not given"),
        "the driver takes them")


def audit_folder(subject: ExaminedSystem) -> Observation:
    """Check the folder of the audit log."""
    from jaka_ros_driver.ros.audit.setting_up import folder_of  # needs rospy, which may be what is missing
    if not subject.config.audit_dir:
        return skipped("the audit log is switched off by ~audit_dir",
                       "set audit_dir: then it is recorded who does what")
    return look_at_folder(folder_of(subject.config), "nobody records who does what with the arm",
                          "audit_dir:=FOLDER that this user can write to")


def runtime_folder(subject: ExaminedSystem) -> Observation:
    """Check the folder of the notes that a driver leaves for the next one: that the arm moves, that it has started."""
    config = subject.config
    note = RuntimeFile("doctor", config.ip, config.command_port)
    try:
        note.write("{}")
    except OSError as error:
        return fault("%s: %s" % (error.filename or "no folder", error.strerror or error),
                     "after a crash the next driver does not know that the arm moves",
                     "give XDG_RUNTIME_DIR a folder of this user with mode 0700")
    finally:
        with contextlib.suppress(OSError):
            note.remove()
    return good("notes for the next driver can be written", "a driver that follows a crash stops what still moves")


def other_driver(subject: ExaminedSystem) -> Observation:
    """Check whether a driver of this computer has the controller."""
    if not subject.has_controller:
        return skipped("no controller was named", "jaka_doctor ip:=ADDRESS")
    if subject.holder:
        return good("%s has this controller" % subject.holder,
                    "it runs, and its /diagnostics say more; a second driver cannot start (exit code 3)")
    return good("no driver of this computer has the controller", "one can start; other computers are not seen")


CHECKS = (Examination("parameters", parameters), Examination("audit log folder", audit_folder),
          Examination("runtime folder", runtime_folder), Examination("other driver", other_driver))
