"""Findings: what is wrong at which place of a program, why it matters, what to do; and their bounded collection."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import asdict, dataclass, field, replace
from enum import Enum
from typing import Any


class Severity(Enum):
    """An error must not be sent; a warning wants a look; a note costs time or bytes only."""

    ERROR = "error"
    WARNING = "warning"
    NOTE = "note"


@dataclass(frozen=True, slots=True)
class Finding:
    """One finding; `line` and `column` count from 1, 0 where the whole program is meant."""

    id: str
    severity: Severity
    line: int
    column: int
    text: str
    reason: str
    remedy: str
    block: int | None = None

    def sentence(self, program: str) -> str:
        """One line for a person."""
        place = ":".join(str(part) for part in (program, self.line, self.column) if part)
        block = f" N{self.block}" if self.block is not None else ""
        return f"{place}:{block} {self.severity.value} {self.id}: {self.text}; {self.reason}; {self.remedy}"


@dataclass(slots=True)
class Collection:
    """The first findings of every id, and how many more there were: a bad file of any size stays small here."""

    most_per_id: int = 20
    findings: list[Finding] = field(default_factory=list)
    counts: Counter[str] = field(default_factory=Counter)
    severities: Counter[Severity] = field(default_factory=Counter)

    def add(self, found: Iterable[Finding]) -> None:
        """Keep these findings, or count them where there are enough of a kind."""
        for finding in found:
            self.keep(finding)

    def keep(self, finding: Finding, line: int = 0, block: int | None = None) -> None:
        """Keep or count one finding; one at `line` belongs to `block`."""
        self.counts[finding.id] += 1
        self.severities[finding.severity] += 1
        if self.counts[finding.id] <= self.most_per_id:
            is_here = finding.line == line and block is not None
            self.findings.append(replace(finding, block=block) if is_here else finding)

    @property
    def has_errors(self) -> bool:
        """Whether anything forbids sending."""
        return self.severities[Severity.ERROR] > 0

    def report(self) -> dict[str, Any]:
        """The report of docs/interface, section 5, in the order of the program."""
        ordered = sorted(self.findings, key=lambda finding: (finding.line, finding.column))
        return {
            "schema": "dripmill.check",
            "version": 1,
            "findings": [{**asdict(finding), "severity": finding.severity.value} for finding in ordered],
            "errors": self.severities[Severity.ERROR],
            "warnings": self.severities[Severity.WARNING],
            "notes": self.severities[Severity.NOTE],
            "not_listed": {
                name: count - self.most_per_id for name, count in self.counts.items() if count > self.most_per_id
            },
        }
