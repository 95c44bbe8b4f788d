"""Reader of zip archives, as phyphox, loggers in the cloud and mail programs send them.

Each file of the archive is read by the reader of its format, so an archive of several tables is
read like the sheets of a workbook.
"""

from __future__ import annotations

import zipfile
from collections.abc import Sequence
from dataclasses import dataclass
from typing import BinaryIO, Final, cast

from identification.errors import FileTooLarge, RunFileError
from identification.ingest.display import plain
from identification.ingest.file import RunFile
from identification.ingest.formats.library import decoding
from identification.ingest.reader import Reader, SourceTable, TableSet

__all__ = ["ArchiveReader"]

_WHAT: Final = "a zip archive"
_MOST_MEMBERS = 20


@dataclass(frozen=True)
class ArchiveReader:
    """Reader of the tables in an archive, none of which is an archive itself."""

    readers: Sequence[Reader]
    """Readers of its files, in the order in which they are asked."""

    def recognises(self, name: str, head: bytes) -> bool:
        """Return True for a zip archive; a workbook, which is one, has a reader before this one."""
        return head.startswith((b"PK\x03\x04", b"PK\x05\x06"))

    def open(self, file: RunFile) -> SourceTable | TableSet:
        """Open every file of the archive; those without a table are left out.

        Raises:
            FileTooLarge: The archive has too many files, or unpacks to more than the limit.
            RunFileError: No file has a table.
        """
        with decoding(_WHAT, (zipfile.BadZipFile,)):
            archive = zipfile.ZipFile(file.seekable())
            # macOS adds a directory __MACOSX and files that begin with a point.
            members = {
                plain(one.filename, 200): one
                for one in archive.infolist()
                if not (
                    one.is_dir() or any(p.startswith((".", "__")) for p in one.filename.split("/"))
                )
            }
        size = sum(member.file_size for member in members.values())
        if len(members) > _MOST_MEMBERS or size > file.limits.bytes:
            raise FileTooLarge(
                f"the archive has {len(members)} files of {size} bytes, more than the limit of "
                f"{_MOST_MEMBERS} files or {file.limits.bytes} bytes; unpack it, and give the file "
                "with the samples",
                value=size,
            )
        opened: dict[str, SourceTable | TableSet] = {}
        errors: list[RunFileError] = []
        for name, member in members.items():
            try:
                with decoding(_WHAT, (zipfile.BadZipFile,)):
                    content = RunFile(cast("BinaryIO", archive.open(member)), name, file.limits)
                reader = next(r for r in self.readers if r.recognises(name, content.head))
                opened[name] = reader.open(content)
            except RunFileError as error:
                errors.append(error)
        if errors and not opened:
            raise errors[0]
        if len(opened) == 1:
            return next(iter(opened.values()))
        tables: dict[str, SourceTable] = {}
        for name, found in opened.items():
            each = found.tables if isinstance(found, TableSet) else {"": found}
            tables |= {f"{name}/{one}".rstrip("/"): table for one, table in each.items()}
        return TableSet("file", tables)
