"""The findings of a check, by section, and how they are printed: as a list to follow, or as JSON."""
import json
from dataclasses import dataclass, field
from typing import Any, Dict, List, Optional

FITS = "fits"
MUST_CHANGE = "must change"
ADVICE = "advice"
NOT_READ = "not read"
SECTIONS = (FITS, MUST_CHANGE, ADVICE, NOT_READ)
_LONGEST_TEXT = 1200
"""Most characters of a finding: a hostile file cannot fill the screen with one of its names."""


@dataclass(frozen=True)
class ConfigFinding:
    """One line of a report.

    Attributes:
        section: One of ``SECTIONS``.
        text: What was found, and what to do about it.
        file: The file, relative to the package where it lies in it; empty where no file is meant.
        line: The line in it, from 1; None where the whole file is meant.
    """

    section: str
    text: str
    file: str = ""
    line: Optional[int] = None

    @property
    def place(self) -> str:
        """The file and line as editors take them: ``config/a.yaml:3``."""
        return self.file if self.line is None else "%s:%d" % (self.file, self.line)


def printable(text: str) -> str:
    """Return a text in one line without control characters, so that a file's name or value moves no cursor."""
    shown = "".join(letter if letter.isprintable() else " " for letter in text)
    return shown if len(shown) <= _LONGEST_TEXT else shown[:_LONGEST_TEXT] + "..."


@dataclass
class ConfigReport:
    """The findings about one MoveIt configuration.

    Attributes:
        package: The folder that was read.
        model: The arm's model, and where its name comes from.
        findings: In the order in which they were made.
        is_broken: True where a file that MoveIt loads, or one that was named, cannot be read.
    """

    package: str
    model: str = ""
    findings: List[ConfigFinding] = field(default_factory=list)
    is_broken: bool = False

    def add(self, section: str, text: str, file: str = "", line: Optional[int] = None) -> None:
        """Add a finding; the arguments are those of ``ConfigFinding``."""
        self.findings.append(ConfigFinding(section, printable(text), printable(file), line))

    def broken(self, text: str, file: str, line: Optional[int] = None) -> None:
        """Add a file that is there and cannot be read."""
        self.is_broken = True
        self.add(NOT_READ, text, file, line)

    def of(self, section: str) -> List[ConfigFinding]:
        """Return the findings of a section."""
        return [finding for finding in self.findings if finding.section == section]

    @property
    def exit_code(self) -> int:
        """The exit code: 1 where something must change, else 2 where a file cannot be read, else 0."""
        return 1 if self.of(MUST_CHANGE) else 2 if self.is_broken else 0

    def as_text(self) -> str:
        """Return the report for people, by section; a section without findings is left out."""
        lines = ["%s, checked for model %s" % (printable(self.package), printable(self.model))]
        for section in SECTIONS:
            found = self.of(section)
            if found:
                lines += ["", "%s (%d)" % (section, len(found))]
                lines += ["  - %s%s" % (finding.place + ": " if finding.file else "", finding.text)
                          for finding in found]
        lines += ["", ", ".join("%s: %d" % (section, len(self.of(section))) for section in SECTIONS)]
        return "\n".join(lines) + "\n"

    def as_json(self) -> str:
        """Return the report as one JSON object; its sections have underscores for spaces."""
        answer: Dict[str, Any] = {"package": self.package, "model": self.model, "exit_code": self.exit_code}
        for section in SECTIONS:
            answer[section.replace(" ", "_")] = [
                {"file": finding.file or None, "line": finding.line, "text": finding.text}
                for finding in self.of(section)]
        return json.dumps(answer, indent=2) + "\n"
