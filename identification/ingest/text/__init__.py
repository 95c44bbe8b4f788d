"""Reader of text tables, with any usual delimiter, decimal sign and encoding.

file -> blocks of lines -> layout  -> columns -> cells
        blocks             dialect    names      fast, else scan
"""

from __future__ import annotations

from identification.ingest.text.table import TextReader, open_text

__all__ = ["TextReader", "open_text"]
