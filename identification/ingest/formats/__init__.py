"""Readers of binary formats, each through the library of its format.

A library is imported when a file of its format is opened; those that are not installed with
motorid belong to the extra ``formats``.
"""

from __future__ import annotations

from identification.ingest.formats.archive import ArchiveReader
from identification.ingest.formats.hdf5 import Hdf5Reader
from identification.ingest.formats.matlab import MatlabReader
from identification.ingest.formats.mdf import MdfReader
from identification.ingest.formats.parquet import ParquetReader
from identification.ingest.formats.tdms import TdmsReader
from identification.ingest.formats.workbook import WorkbookReader
from identification.ingest.reader import Reader
from identification.ingest.text import TextReader

__all__ = ["FORMAT_READERS"]

_READERS: tuple[Reader, ...] = (
    WorkbookReader(),
    ParquetReader(),
    TdmsReader(),
    MdfReader(),
    MatlabReader(),
    Hdf5Reader(),
)
FORMAT_READERS: tuple[Reader, ...] = (*_READERS, ArchiveReader((*_READERS, TextReader())))
"""Readers of binary formats; each recognises its files by their first bytes."""
