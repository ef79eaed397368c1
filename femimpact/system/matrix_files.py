"""Matrices of other programs, from files."""

from __future__ import annotations

import gzip
import math
import re
import zipfile
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import scipy.sparse as sparse
from numpy.lib import format as npy
from numpy.typing import NDArray

from femimpact.arrays import Array
from femimpact.errors import LONGEST_SHOWN, Fault, InputError, checked, optional, require, require_path, text
from femimpact.regular_file import decimal_number, open_regular
from femimpact.system.matrices import MOST_DOFS, Matrix, checked_matrix

SUFFIXES = (".mtx", ".mtx.gz", ".npz")

MOST_BYTES = 2_000_000_000
"""Most bytes of a file, and of its content where it is compressed."""

MOST_ENTRIES = 50_000_000
"""Most entries of a Matrix Market file."""

LINES = 100_000
"""Read at once of a text file."""

LONGEST_LINE = 10_000
"""Bytes; a file without ends of lines is no text."""

BANNER = re.compile(
    r"%%MatrixMarket\s+matrix\s+(?P<layout>coordinate|array)\s+(?P<field>real|double|integer|unsigned-integer|pattern)"
    r"\s+(?P<symmetry>general|symmetric)\s*",
    re.ASCII | re.IGNORECASE,
)

COMPRESSED = ("indices", "indptr")
OF_FORMAT: dict[str, tuple[str, ...]] = {
    "csr": COMPRESSED, "csc": COMPRESSED, "bsr": COMPRESSED, "coo": ("row", "col"), "dia": ("offsets",)
}  # fmt: skip
"""Arrays of whole numbers of a sparse matrix that scipy saved, beside its data and its shape."""


def read_matrix(path: str | Path, name: str | None = None) -> Matrix:
    """A symmetric matrix from a file, for `System.from_matrices`.

    Parameters
    ----------
    path : str or Path
        Matrix Market (.mtx, .mtx.gz), or .npz: a sparse matrix as scipy saves it, or arrays by name as numpy does.
    name : str, optional
        Of the array in an .npz file with several.

    Returns
    -------
    csr_array (dofs, dofs)

    Raises
    ------
    InputError
        If there is no such file or array, it cannot be read, or holds no square, symmetric matrix of finite numbers;
        with the line and its text where a line of a Matrix Market file is not what the format asks for.
    """
    require_path(path, "path", "a matrix file")
    checked("name", name, optional(text()))
    path = Path(path)
    known = path.name.endswith(SUFFIXES)
    require(known, "path", str(path), "", f"must end with {', '.join(SUFFIXES)}")
    try:
        with open_regular(path, MOST_BYTES) as file:
            if path.suffix == ".npz":
                matrix = _of_archive(file, name)
            elif path.suffix == ".gz":
                with gzip.GzipFile(fileobj=file) as unpacked:
                    matrix = _of_market(_Text(unpacked))  # type: ignore[arg-type]
            else:
                matrix = _of_market(_Text(file))
    except InputError:
        raise
    # what a damaged archive makes its reader raise is without limit
    except Exception as error:
        reason = getattr(error, "strerror", None) or str(error)
        words = " ".join(reason.split())[:300] or type(error).__name__
        raise InputError([Fault("path", str(path), "", f"must be a readable matrix file: {words}")]) from None
    return checked_matrix(path.name, matrix)


# ---- Matrix Market --------------------------------------------------------------------------------


class _Text:
    """Lines of a file, counted from 1, in no more bytes than allowed."""

    def __init__(self, file: BinaryIO) -> None:
        self.file = file
        self.number = self.size = 0

    def next_lines(self, most: int) -> list[tuple[int, str]]:
        """The next lines that are neither empty nor comments, with their numbers; none at the end."""
        lines: list[tuple[int, str]] = []
        while len(lines) < most and (line := self.file.readline(LONGEST_LINE)):
            self.size += len(line)
            self.number += 1
            if len(line) == LONGEST_LINE or self.size > MOST_BYTES:
                raise ValueError(f"line {self.number} is longer than {LONGEST_LINE}, or all than {MOST_BYTES:,} bytes")
            text = line.decode("ascii", errors="replace").strip()
            if text and (text[0] != "%" or self.number == 1):
                lines.append((self.number, text))
        return lines


@dataclass(frozen=True)
class _Layout:
    """Format of the lines of a Matrix Market file, from its head."""

    dense: bool
    pattern: bool
    integer: bool
    symmetric: bool
    rows: int
    columns: int
    entries: int
    line: int

    @property
    def width(self) -> int:
        """Numbers of a line."""
        return 1 if self.dense else 2 if self.pattern else 3

    @property
    def words(self) -> str:
        """The allowed content of a line, in words."""
        value = "a whole number" if self.integer else "a finite decimal number"
        place = f"row (1 to {self.rows}), column (1 to {self.columns})"
        return value if self.dense else place if self.pattern else f"{place} and {value}"

    def are_sound(self, table: Array) -> NDArray[np.bool_]:
        """True for lines (entries, width) of numbers that the format allows."""
        places = table[:, : 0 if self.dense else 2]
        largest = (self.rows, self.columns)[: places.shape[1]]
        integers = table[:, : self.width if self.integer else places.shape[1]]
        sound = np.isfinite(table).all(axis=1) & ((places >= 1) & (places <= largest)).all(axis=1)
        return np.asarray(sound & (integers == np.floor(integers)).all(axis=1))


def _of_market(text: _Text) -> Any:
    """The matrix of a Matrix Market file; an error names the line and its text."""
    layout = _layout(text)
    blocks, count = [np.zeros((0, layout.width))], 0
    while lines := text.next_lines(LINES):
        blocks.append(_numbers(lines, layout))
        count += len(lines)
        if count > layout.entries:
            break
    if count != layout.entries:
        count_words = "more" if count > layout.entries else str(count)
        raise ValueError(f"line {layout.line} announces {layout.entries} entries, there are {count_words}")
    return _assembled(np.concatenate(blocks), layout)


def _layout(text: _Text) -> _Layout:
    """The first two lines of a Matrix Market file that are no comments."""
    number, line = next(iter(text.next_lines(1)), (1, ""))
    banner = BANNER.fullmatch(line)
    if banner is None:
        kinds = "coordinate or array, real, integer or pattern, symmetric or general"
        raise _bad_line(number, line, f"%%MatrixMarket matrix and its kind: {kinds}")
    layout, field, symmetry = (banner[name].lower() for name in ("layout", "field", "symmetry"))
    dense, pattern, symmetric = layout == "array", field == "pattern", symmetry == "symmetric"
    number, line = next(iter(text.next_lines(1)), (text.number + 1, ""))
    sizes = [int(cell) for cell in line.split() if re.fullmatch(r"\d{1,18}", cell, re.ASCII)]
    fits = len(sizes) == len(line.split()) == (2 if dense else 3) and not (dense and pattern)
    if not fits:
        raise _bad_line(number, line, f"whole numbers: {'rows, columns' if dense else 'rows, columns, entries'}")
    rows, columns, *rest = sizes
    entries = rest[0] if rest else rows * (rows + 1) // 2 if symmetric else rows * columns
    if max(rows, columns) > MOST_DOFS or entries > MOST_ENTRIES or (symmetric and rows != columns):
        raise _bad_line(number, line, f"at most {MOST_DOFS:,} rows, square if symmetric, and {MOST_ENTRIES:,} entries")
    return _Layout(dense, pattern, field.endswith("integer"), symmetric, rows, columns, entries, number)


def _numbers(lines: list[tuple[int, str]], layout: _Layout) -> Array:
    """The numbers of lines (lines, width)."""
    with suppress(ValueError):
        # quick, and as strict; what it refuses is found below
        table = np.loadtxt([line for _, line in lines], comments=None, ndmin=2)
        if table.shape == (len(lines), layout.width) and layout.are_sound(table).all():
            return table
    rows = []
    for number, line in lines:
        values = [decimal_number(cell) for cell in line.split()]
        row = np.array([[math.nan if value is None else value for value in values]])
        if row.shape[1] != layout.width or not layout.are_sound(row).all():
            raise _bad_line(number, line, layout.words)
        rows.append(row)
    return np.concatenate(rows)


def _assembled(table: Array, layout: _Layout) -> Any:
    """The sparse matrix of the numbers of all lines."""
    shape = (layout.rows, layout.columns)
    if layout.dense and layout.symmetric:
        # column by column of the lower triangle, which is row by row of the upper one
        column, row = np.triu_indices(layout.rows)
    elif layout.dense:
        column, row = np.divmod(np.arange(layout.entries), max(layout.rows, 1))
    else:
        row, column = table[:, :2].astype(int).T - 1
    values = np.ones(len(table)) if layout.pattern else table[:, -1]
    if layout.symmetric:
        off = row != column
        row, column = np.concatenate([row, column[off]]), np.concatenate([column, row[off]])
        values = np.concatenate([values, values[off]])
    matrix = sparse.coo_array((values, (row, column)), shape=shape).tocsr()
    if matrix.nnz < values.size:
        both = ", as where a symmetric one has both of its halves" if layout.symmetric else ""
        raise ValueError(f"an entry stands in it more than once{both}")
    return matrix


def _bad_line(number: int, line: str, allowed: str) -> ValueError:
    beginning = line if len(line) <= LONGEST_SHOWN else f"{line[:LONGEST_SHOWN]}..."
    return ValueError(f"line {number}, {beginning!r}, must be {allowed}")


# ---- archives of numpy ----------------------------------------------------------------------------


def _of_archive(file: BinaryIO, name: str | None) -> Any:
    with zipfile.ZipFile(file) as archive:
        members = {item.filename.removesuffix(".npy"): item for item in archive.infolist()}
        if name is None and {"format", "shape", "data"} <= set(members):
            return _sparse(archive, members)
        names = list(members)
        chosen = names[0] if name is None and len(names) == 1 else name
        require(chosen in names, "name", chosen, "", f"must be one of the arrays of the file: {', '.join(names)}")
        return _array(archive, members[str(chosen)])


def _sparse(archive: zipfile.ZipFile, members: dict[str, zipfile.ZipInfo]) -> Any:
    """A sparse matrix that scipy saved; its indices are checked by `checked_matrix`."""
    kind = str(_array(archive, members["format"]).astype(str))
    shape = tuple(int(size) for size in _array(archive, members["shape"]))
    if kind not in OF_FORMAT or len(shape) != 2 or not all(0 <= size <= MOST_DOFS for size in shape):
        raise ValueError(f"a matrix of format {kind[:20]!r} and shape {shape}, and not of at most {MOST_DOFS:,} rows")
    data, *places = (_array(archive, members[name]) for name in ("data", *OF_FORMAT[kind]))
    if any(array.dtype.kind not in "iu" for array in places):
        raise ValueError("its indices are no whole numbers")
    parts = (data, tuple(places)) if kind == "coo" else (data, *places)
    return getattr(sparse, f"{kind}_array")(parts, shape=shape)


def _array(archive: zipfile.ZipFile, item: zipfile.ZipInfo) -> NDArray[Any]:
    """An array of numbers or texts, whose size is that of the file: nothing is allocated for one that is not."""
    if item.file_size > MOST_BYTES:
        raise ValueError(f"{item.filename} has {item.file_size:,} bytes, of which at most {MOST_BYTES:,} are read")
    with archive.open(item) as member:
        version = npy.read_magic(member)
        read_header = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
        shape, by_columns, dtype = read_header(member)
        size, stated = item.file_size - member.tell(), math.prod(shape) * dtype.itemsize
        if dtype.kind not in "biufSU" or min(shape, default=0) < 0 or size != stated:
            raise ValueError(f"{item.filename} is no array {shape} of {dtype} in {size:,} bytes")
        # to the end, where its checksum is looked at
        content = member.read()
    array = np.frombuffer(content, dtype=dtype) if stated else np.zeros(0, dtype)
    return array.reshape(shape, order="F" if by_columns else "C")
