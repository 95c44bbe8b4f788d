"""Reader of Parquet files, with pyarrow.

Only the columns of channels are read.  The unit of a column is part of its name or stands in the
metadata of its field under ``unit`` or ``units``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import ArrayLike

from identification.errors import UnsupportedContent
from identification.ingest.columns import Column, describe_column
from identification.ingest.file import RunFile
from identification.ingest.formats.library import decoding, imported
from identification.ingest.reader import ColumnTable, refuse_large

if TYPE_CHECKING:
    import pyarrow

__all__ = ["ParquetReader"]

_WHAT: Final = "a Parquet file"
_UNIT_KEYS = (b"unit", b"units", b"Unit", b"Units")


class ParquetReader:
    """Reader of Parquet; Feather and Arrow files are refused."""

    def recognises(self, name: str, head: bytes) -> bool:
        """Return True for the signatures of Parquet and of Arrow."""
        return head.startswith((b"PAR1", b"ARROW1", b"FEA1"))

    def open(self, file: RunFile) -> ColumnTable:
        """Read the schema.

        Raises:
            UnsupportedContent: The file is in the format of Arrow or Feather.
            FileTooLarge: The file declares more rows or columns than the limits.
        """
        if not file.head.startswith(b"PAR1"):
            raise UnsupportedContent(
                "this is an Arrow or Feather file, whose content cannot be checked before it is "
                "read; write Parquet instead, for example with pyarrow.parquet.write_table"
            )
        library = imported("pyarrow.parquet", _WHAT)
        with decoding(_WHAT):
            opened = library.ParquetFile(file.seekable(), page_checksum_verification=True)
            schema = opened.schema_arrow
            refuse_large(file.limits, opened.metadata.num_rows, len(schema))
            columns = [_column(k, schema.field(k)) for k in range(len(schema))]

        def load(column: Column) -> ArrayLike:
            with decoding(_WHAT):
                name = schema.field(column.index).name
                cells = opened.read(columns=[name], use_threads=False).column(0)
                if str(cells.type).startswith("decimal"):
                    cells = cells.cast("float64")
                return np.asarray(cells.to_numpy())

        return ColumnTable(columns, load)


def _column(index: int, field: pyarrow.Field) -> Column:
    metadata = field.metadata or {}
    units = [metadata[key].decode("utf-8", "replace") for key in _UNIT_KEYS if key in metadata]
    if str(field.type).startswith(("timestamp", "duration")):
        units = ["s"]
    return describe_column(index, [field.name], units[:1])
