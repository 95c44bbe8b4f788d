"""Hostile files: decompression bombs, crashing files and huge texts, generated on demand."""

from __future__ import annotations

import base64
import bz2
import gzip
import lzma
import tarfile
import zipfile
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

__all__ = ["BOMBS", "FLOODS", "Maker"]

Maker = Callable[[Path, int], None]
"""Writes a bomb of the given unpacked size [bytes]."""

_BLOCK = b"0" * (1 << 20)

# A MATLAB 5 file with one length changed; scipy.io.loadmat ends with a segmentation fault.
_CRASHER = (
    "eNrzdQzxcXRSMNUzUPB1DNFNy8xJVQjISSxJyy/KtVIoyC/OrNBRcC5KTSxJTVHIz7NSCE4sUfDLL1MwMlQwtLAytbAy"
    "MVAwMjAyYyADMHr68gGpDCBmA2IOIGYFYiYozQFlgzAjEOaCxPkh4mDtUHU8SHwmKJsTiAXgFn2wR6WpBwC/SBmB"
)


def _zeros(size: int) -> Iterator[bytes]:
    yield from (_BLOCK for _ in range(max(1, size // len(_BLOCK))))


def _mat_crasher(path: Path, size: int) -> None:
    path.write_bytes(zlib.decompress(base64.b64decode(_CRASHER)))


def _mat_bomb(path: Path, size: int) -> None:
    # MAT 5 stores a variable as one zlib stream, whose header contains its length.
    packer = zlib.compressobj(9)
    body = packer.compress(b"\x0e\0\0\0" + min(size, 2**31).to_bytes(4, "little"))
    body += b"".join(map(packer.compress, _zeros(size))) + packer.flush()
    head = b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM"
    path.write_bytes(head + b"\x0f\0\0\0" + len(body).to_bytes(4, "little") + body)


def _zip(path: Path, size: int, name: str) -> None:
    with (
        zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive,
        archive.open(name, "w", force_zip64=True) as file,
    ):
        for block in _zeros(size):
            file.write(block)


def _npz(path: Path, size: int) -> None:
    header = f"{{'descr': '|u1', 'fortran_order': False, 'shape': ({size},), }}"
    header = header.ljust(128 - 10 - 1) + "\n"
    with (
        zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive,
        archive.open("a.npy", "w", force_zip64=True) as file,
    ):
        file.write(b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header.encode())
        for block in _zeros(size):
            file.write(block)


def _packed(opener: Callable[..., Any]) -> Maker:
    def make(path: Path, size: int) -> None:
        with opener(path, "wb") as file:
            for block in _zeros(size):
                file.write(block)

    return make


def _tar_gz(path: Path, size: int) -> None:
    inner = path.with_suffix(".inner")
    with inner.open("wb") as file:
        file.truncate(size)
    with tarfile.open(path, "w:gz") as tar:
        tar.add(inner, "run.csv")
    inner.unlink()


def _parquet(path: Path, size: int) -> None:
    import pyarrow
    import pyarrow.parquet

    rows = 4_000_000
    table = pyarrow.table({"time_s": pyarrow.array([0.0] * 1).take(pyarrow.array([0] * rows))})
    with pyarrow.parquet.ParquetWriter(path, table.schema, compression="zstd") as writer:
        for _ in range(max(1, size // (8 * rows))):
            writer.write_table(table)


@contextmanager
def _hdf5(path: Path) -> Iterator[Any]:
    import h5py

    with h5py.File(path, "w") as file:
        yield file


def _hdf5_bomb(path: Path, size: int) -> None:
    with _hdf5(path) as file:
        # Chunks that were never written are read as zeros, so the file takes some kilobytes.
        file.create_dataset("time_s", (size // 8,), "f8", chunks=(1 << 16,), compression="gzip")


def _hdf5_link(path: Path, size: int) -> None:
    import h5py

    with _hdf5(path) as file:
        for name, place in (("time_s", "/etc/passwd"), ("voltage_V", "../../motorid.sqlite3")):
            file[name] = h5py.ExternalLink(place, "/")


def _hdf5_storage(path: Path, size: int) -> None:
    with _hdf5(path) as file:
        file.create_dataset("time_s", (64,), "u1", external=[("/etc/passwd", 0, 64)])


def _quotes(path: Path, size: int) -> None:
    _repeated(path, b'"', b"", size)


def _repeated(path: Path, head: bytes, unit: bytes, size: int) -> None:
    block = (unit or head) * (1 + (1 << 20) // len(unit or head))
    with path.open("wb") as file:
        file.write(head)
        for _ in range(max(1, size // len(block))):
            file.write(block)


_HEADER = b"time_s,voltage_V,current_A,speed_rad_s,temperature_degC\n"


def _text(head: bytes, unit: bytes) -> Maker:
    return lambda path, size: _repeated(path, head, unit, size)


BOMBS: dict[str, Maker] = {
    "crash.mat": _mat_crasher,
    "bomb.mat": _mat_bomb,
    "bomb.parquet": _parquet,
    "bomb.h5": _hdf5_bomb,
    "external_link.h5": _hdf5_link,
    "external_storage.h5": _hdf5_storage,
    "bomb.npz": _npz,
    "bomb.zip": lambda path, size: _zip(path, size, "run.csv"),
    "bomb.xlsx": lambda path, size: _zip(path, size, "xl/worksheets/sheet1.xml"),
    "bomb.csv.gz": _packed(gzip.open),
    "bomb.csv.bz2": _packed(bz2.open),
    "bomb.csv.xz": _packed(lzma.open),
    "bomb.tar.gz": _tar_gz,
}
"""Files that expand by a large factor, crash a reader, or refer to other files, by name."""

FLOODS: dict[str, Maker] = {
    "one_line.csv": _text(b"time_s,voltage_V", b",1.5"),
    "one_cell.csv": _text(_HEADER, b"1"),
    "zeros.csv": _text(b"\0", b"\0"),
    "line_ends.csv": _text(_HEADER, b"\n"),
    "quotes.csv": _quotes,
    "commas.csv": _text(b",", b","),
    "columns.csv": _text(b"a", b",b"),
    "utf_16_line.csv": _text(b"\xff\xfe", b"1\0"),
    "short_rows.csv": _text(_HEADER, b"0,1,2,3,4\n"),
    "no_utf_8.csv": _text(_HEADER, b"\xff\xfe\xfd\n"),
}
"""Texts without compression, by name."""
