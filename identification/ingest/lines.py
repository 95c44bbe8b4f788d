"""Map from sample index to line number in the file."""

from __future__ import annotations

import bisect
from dataclasses import dataclass, field

__all__ = ["SampleLines"]


@dataclass
class SampleLines:
    """Line number of each sample, stored as ranges of consecutive lines."""

    first_samples: list[int] = field(default_factory=list)
    first_lines: list[int] = field(default_factory=list)
    total: int = 0

    def extend(self, first_line: int, count: int) -> None:
        """Append `count` samples on consecutive lines, beginning at `first_line`."""
        if not count:
            return
        if not self.total or self.line(self.total - 1) + 1 != first_line:
            self.first_samples.append(self.total)
            self.first_lines.append(first_line)
        self.total += count

    def line(self, sample: int) -> int:
        """Line number, counted from 1, of a sample."""
        at = bisect.bisect_right(self.first_samples, sample) - 1
        return self.first_lines[at] + sample - self.first_samples[at]
