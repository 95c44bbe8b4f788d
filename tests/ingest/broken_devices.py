"""Files of measuring devices that are refused, with the expected error of each."""

from __future__ import annotations

import struct
from pathlib import Path

from identification import errors
from tests.ingest.devices import BROKEN_LVM
from tests.ingest.writers import (
    CHANNELS,
    MDF,
    TIME,
    broken,
    mdf,
)


def outside_of_record(path: Path) -> None:
    """Move the last channel of an MDF file behind the end of its record."""
    mdf(path, {"log": (TIME[2], CHANNELS[1:])}, "4.10")
    content = bytearray(path.read_bytes())
    at = content.rfind(b"##CN")
    links = struct.unpack_from("<Q", content, at + 16)[0]
    # The offset in bytes stands behind four bytes of types.
    struct.pack_into("<I", content, at + 24 + 8 * links + 4, 10_000)
    path.write_bytes(content)


BROKEN_DEVICES = (
    broken(
        "run.mf4",
        "a channel outside of its record",
        outside_of_record,
        errors.DamagedFile,
        "a channel ends at byte 10008 of a record of 40",
        needs=MDF,
    ),
    broken(
        "run.lvm",
        "LabVIEW with different clocks, imitated",
        lambda p: p.write_text(BROKEN_LVM),
        errors.UnsupportedContent,
        "the channels have different clocks (delta_x '0.001', '0.1')",
        "write TDMS",
    ),
)
