"""Reader of Excel and OpenDocument workbooks, with python-calamine.

The rows of a sheet are read as a text table, so headers, units, blank cells and row numbers in
messages are those of a text file.
"""

from __future__ import annotations

import datetime
import itertools
import zipfile
from collections.abc import Iterable, Iterator
from typing import BinaryIO, Final

from identification.errors import FileTooLarge, RunFileError
from identification.ingest.file import RunFile
from identification.ingest.formats.library import decoding, imported
from identification.ingest.reader import SourceTable, TableSet
from identification.ingest.text import open_text

__all__ = ["WorkbookReader"]

_WHAT: Final = "a workbook (XLSX, XLS or ODS)"
_ZIP = b"PK\x03\x04"
# First members of the archives that Excel and LibreOffice write.
_MEMBERS = (b"xl/", b"[Content_Types].xml", b"_rels/", b"mimetypeapplication/vnd.oasis.opendoc")
_OLE = b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1"
# A sheet has at most 1,048,576 rows; eight columns of them take less.
_LARGEST_XML = 1_000_000_000
_CHUNK_ROWS = 10_000

Cell = str | float | bool | datetime.date | datetime.time | datetime.timedelta


class WorkbookReader:
    """Reader of all sheets of a workbook."""

    def recognises(self, name: str, head: bytes) -> bool:
        """Return True for an archive with the members of a workbook, and for an old Excel file."""
        return head.startswith(_OLE) or (
            head.startswith(_ZIP) and any(member in head[:4096] for member in _MEMBERS)
        )

    def open(self, file: RunFile) -> TableSet:
        """Find the header of every sheet; sheets without a table are left out."""
        calamine = imported("python_calamine", _WHAT)
        stream = file.seekable()
        tables: dict[str, SourceTable] = {}
        errors: list[RunFileError] = []
        with decoding(_WHAT, (calamine.CalamineError, zipfile.BadZipFile)):
            _refuse_large(file, stream)
            workbook = calamine.CalamineWorkbook.from_filelike(stream)
            for sheet in workbook.sheets_metadata:
                if sheet.typ != calamine.SheetTypeEnum.WorkSheet:
                    continue
                rows = workbook.get_sheet_by_name(sheet.name).iter_rows()
                try:
                    tables[sheet.name] = open_text(_text(rows), file.limits, file.name)
                except RunFileError as error:
                    errors.append(error)
        if errors and not tables:
            # The error of the sheet that came closest to a table.
            raise max(errors, key=lambda error: error.row or 0)
        return TableSet("sheet", tables)


def _refuse_large(file: RunFile, stream: BinaryIO) -> None:
    """Reject an archive that declares more content than a sheet of a run can have."""
    if not file.head.startswith(_ZIP):
        return
    with zipfile.ZipFile(stream) as archive:
        size = sum(member.file_size for member in archive.infolist())
    stream.seek(0)
    if size > _LARGEST_XML:
        raise FileTooLarge(
            f"the workbook unpacks to {size} bytes, more than the limit of {_LARGEST_XML}; "
            "export the run as a text table (CSV, UTF-8)",
            value=size,
        )


def _text(rows: Iterable[list[Cell]]) -> Iterator[bytes]:
    """Rows as lines of a text table, in chunks; numbers keep every digit."""
    lines = (
        ";".join(map(_cell, row)) + "\n" if any(cell != "" for cell in row) else "\n"
        for row in rows
    )
    while chunk := "".join(itertools.islice(lines, _CHUNK_ROWS)):
        yield chunk.encode("utf-8", "replace")


def _cell(value: Cell) -> str:
    match value:
        case bool():
            return str(int(value))
        case float() | int():
            return repr(value)
        case datetime.timedelta() if value >= datetime.timedelta():
            hours, rest = divmod(value, datetime.timedelta(hours=1))
            # The digits behind the hours are those of a time of day.
            return f"{hours:02d}{(datetime.datetime.min + rest).time().isoformat()[2:]}"
        case datetime.timedelta():
            return repr(value.total_seconds())
        case datetime.datetime() | datetime.time():
            return value.isoformat()
        case datetime.date():
            # The library gives midnight as a date.
            return f"{value.isoformat()}T00:00:00"
        case _:
            text = " ".join(value.split()).replace('"', "'").replace("\0", " ")
            return f'"{text}"' if text else ""
