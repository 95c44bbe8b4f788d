"""Which line of the file each sample came from."""

from __future__ import annotations

import bisect
from dataclasses import dataclass, field

__all__ = ["SampleLines"]


@dataclass
class SampleLines:
    """Line of the file for each sample, kept as stretches without a gap."""

    first_samples: list[int] = field(default_factory=list)
    first_lines: list[int] = field(default_factory=list)
    total: int = 0

    def extend(self, first_line: int, count: int) -> None:
        """Add `count` samples on consecutive lines."""
        if not count:
            return
        if not self.total or self.line(self.total - 1) + 1 != first_line:
            self.first_samples.append(self.total)
            self.first_lines.append(first_line)
        self.total += count

    def line(self, sample: int) -> int:
        """Line of the file, counted from 1, that holds a sample."""
        at = bisect.bisect_right(self.first_samples, sample) - 1
        return self.first_lines[at] + sample - self.first_samples[at]
