"""Damaged and lying matrix files give the right matrix or one line, and sparse matrices are checked before use."""

from __future__ import annotations

import io
import json
import subprocess
import sys
import zipfile

import numpy as np
import pytest
import scipy.sparse as sparse

import femimpact as fi

SYMMETRIC = np.array([[2.0, -1.0, 0.0], [-1.0, 3.5, 1e-3], [0.0, 1e-3, 4.0]])
BANNER = "%%MatrixMarket matrix"


def _refused(path, *words):
    with pytest.raises(fi.InputError) as told:
        fi.system.read_matrix(path)
    assert len(str(told.value).splitlines()) == 1
    assert path.name in str(told.value)
    for word in words:
        assert word in str(told.value)


# ---- Matrix Market --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "cell",
    ["1,5", "0x10", "1.5abc", "1e", "1_0", "1.5 7", "-", "1d3", "nan", "inf", "1e400", "\uff11", "1.5 % c", "--1"],
)
@pytest.mark.parametrize("kind", ["coordinate", "array"])
def test_what_is_no_decimal_number_is_refused(tmp_path, kind, cell):
    path = tmp_path / "K.mtx"
    head = f"{BANNER} {kind} real general\n% 1,5\n"
    lines = f"2 2 2\n1 1 3.0\n2 2 {cell}\n" if kind == "coordinate" else f"2 2\n3.0\n0.0\n0.0\n{cell}\n"
    path.write_text(head + lines, encoding="utf-8")
    _refused(path)


@pytest.mark.parametrize("number", ["1.5", ".5", "5.", "-1e-3", "1E+2", "007"])
def test_a_decimal_number_is_what_python_takes_it_for(tmp_path, number):
    path = tmp_path / "K.mtx"
    path.write_text(f"{BANNER} coordinate real general\n\n2 2 2\n  1  1\t{number} \r\n\n2 2 1\n", encoding="ascii")
    assert fi.system.read_matrix(path).toarray().tolist() == [[float(number), 0.0], [0.0, 1.0]]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("coordinate real general\n2 2 2\n0 1 1\n2 2 1\n", ["Line 3"]),
        ("coordinate real general\n2 2 2\n1 3 1\n2 2 1\n", ["Line 3"]),
        ("coordinate real general\n2 2 2\n1.5 1 1\n2 2 1\n", ["Line 3"]),
        ("coordinate integer general\n2 2 2\n1 1 1.5\n2 2 1\n", ["row, column, integer"]),
        ("coordinate pattern general\n2 2 2\n1 1 1\n2 2 1\n", ["row, column"]),
        ("coordinate real general\n2 2 3\n1 1 1\n2 2 1\n", ["Expected another 1 lines"]),
        ("coordinate real general\n2 2 1\n1 1 1\n2 2 1\n", ["Line 4", "Too many lines"]),
        ("coordinate real symmetric\n2 2 4\n1 1 1\n2 2 1\n2 1 1\n1 2 1\n", ["more than once", "both of its halves"]),
        ("coordinate real general\n2 2 3\n1 1 1\n1 1 1\n2 2 1\n", ["more than once"]),
        ("coordinate real general\n2,2 2\n", []),
        ("coordinate real general\n2 2 2\n1 1\n2 2 1\n", []),
        ("coordinate complex general\n1 1 1\n1 1 1 0\n", ["a real one"]),
        ("coordinate real skew-symmetric\n2 2 1\n2 1 1\n", ["a real one"]),
        ("array pattern general\n1 1\n", []),
        ("coordinate real general\n", []),
        ("coordinate real general\n1000000000 1000000000 1\n1 1 1\n", ["at most 1,000,000"]),
        ("coordinate real general\n2 2 1000000000\n1 1 1\n", ["50,000,000"]),
        ("array real general\n100000 100000\n1\n", ["50,000,000"]),
    ],
)
def test_a_file_that_is_no_matrix_is_refused(tmp_path, text, words):
    path = tmp_path / "K.mtx"
    path.write_text(f"{BANNER} {text}", encoding="ascii")
    _refused(path, *words)


@pytest.mark.parametrize("layout", ["coordinate", "array"])
@pytest.mark.parametrize("symmetry", ["general", "symmetric"])
def test_layouts_and_symmetries_mean_the_same_matrix(tmp_path, layout, symmetry):
    size = len(SYMMETRIC)
    # column by column, of a symmetric one from the diagonal on
    places = [(i, j) for j in range(size) for i in range(j if symmetry == "symmetric" else 0, size)]
    values = SYMMETRIC.tolist()
    lines = [f"{i + 1} {j + 1} {values[i][j]}" if layout == "coordinate" else str(values[i][j]) for i, j in places]
    sizes = f"{size} {size}" + (f" {len(lines)}" if layout == "coordinate" else "")
    path = tmp_path / "K.mtx"
    path.write_text("\n".join([f"{BANNER} {layout} real {symmetry}", sizes, *lines]))
    assert (fi.system.read_matrix(path).toarray() == SYMMETRIC).all()


# ---- archives -------------------------------------------------------------------------------------


def _npy(shape, data=b"", descr="<f8", version=(1, 0)):
    """A member of an archive that states a shape."""
    file = io.BytesIO()
    header = {"descr": descr, "fortran_order": False, "shape": shape}
    writer = np.lib.format.write_array_header_1_0 if version == (1, 0) else np.lib.format.write_array_header_2_0
    writer(file, header)
    return file.getvalue() + data


@pytest.mark.parametrize("shape", [(10**9, 10**9), (10**9,), (2**62, 4), (3, 3), (-1, -8), (0, 10**9)])
@pytest.mark.parametrize("version", [(1, 0), (2, 0)])
def test_a_stated_size_that_the_file_does_not_have_is_refused_before_it_is_allocated(tmp_path, shape, version):
    with zipfile.ZipFile(tmp_path / "K.npz", "w") as archive:
        archive.writestr("K.npy", _npy(shape, b"\0" * 64, version=version))
    _refused(tmp_path / "K.npz")


@pytest.mark.parametrize("kind", ["csr", "csc", "coo", "bsr", "dia"])
def test_a_sparse_shape_of_a_billion_is_refused_before_it_is_allocated(tmp_path, kind):
    np.savez(
        tmp_path / "K.npz", format=kind.encode(), shape=(10**9, 10**9), data=np.ones((1, 1, 1)) if kind == "bsr" else
        np.ones((1, 1)) if kind == "dia" else np.ones(1), indices=[0], indptr=[0, 1], row=[0], col=[0], offsets=[0],
    )  # fmt: skip
    _refused(tmp_path / "K.npz")


@pytest.mark.parametrize("kind", ["csr", "csc", "coo", "bsr", "dia"])
@pytest.mark.parametrize("compressed", [False, True])
def test_every_format_of_scipy_is_read(tmp_path, kind, compressed):
    sparse.save_npz(tmp_path / "K.npz", sparse.csr_array(SYMMETRIC).asformat(kind), compressed=compressed)
    assert (fi.system.read_matrix(tmp_path / "K.npz").toarray() == SYMMETRIC).all()


DAMAGE = """
import json, sys
import numpy as np
from pathlib import Path
import femimpact as fi

folder, true = Path(sys.argv[1]), np.array(json.loads(sys.argv[2]))
told = []
for path in sorted(folder.iterdir()):
    print(path.name, file=sys.stderr, flush=True)
    try:
        fine = bool((fi.system.read_matrix(path).toarray() == true).all())
    except fi.InputError as error:
        fine = len(str(error).splitlines()) == 1
    told.append(fine)
print(json.dumps(told))
"""


def _in_a_child(script, *arguments):
    """What a script prints last; an end by a signal is told with the last name that it wrote."""
    done = subprocess.run(
        [sys.executable, "-c", script, *arguments], capture_output=True, text=True, timeout=300, check=False
    )
    assert done.returncode == 0, (done.returncode, done.stderr[-500:])
    return json.loads(done.stdout.splitlines()[-1])


def test_archives_with_sound_checksums_and_any_indices_do_not_end_the_process(tmp_path):
    # every stored number is replaced by one of these, and written anew by numpy
    wild = (-(2**31), -5, -1, 0, 1, 2, 3, 7, 10**8, 2**31 - 1)
    random = np.random.default_rng(2)
    for i in range(400):
        kind = ("csr", "csc", "coo", "bsr", "dia")[i % 5]
        path = tmp_path / f"{i}.npz"
        sparse.save_npz(path, sparse.csr_array(SYMMETRIC).asformat(kind))
        with np.load(path) as archive:
            arrays = {name: np.array(archive[name]) for name in archive.files}
        name = str(random.choice([name for name in arrays if name not in ("format", "data", "_is_array")]))
        for _ in range(int(random.integers(1, 4))):
            arrays[name][int(random.integers(arrays[name].size))] = random.choice(wild)
        np.savez(path, **arrays)
    script = DAMAGE.replace(
        "bool((fi.system.read_matrix(path).toarray() == true).all())", "fi.system.read_matrix(path) is not None"
    )
    assert all(_in_a_child(script, str(tmp_path), "[]"))


# ---- sparse matrices in memory --------------------------------------------------------------------


@pytest.mark.parametrize("made", [sparse.coo_array, sparse.dok_array])
def test_a_sparse_matrix_of_a_billion_rows_is_refused_before_it_is_converted(made):
    large = made((10**9, 10**9))
    with pytest.raises(fi.InputError, match=r"M = .*must be a matrix of at most 1,000,000 rows"):
        fi.System.from_matrices(large, large, large, points={"tip": [1.0]})
    wide = sparse.coo_array((30_000, 30_000))
    with pytest.raises(fi.InputError, match="must have at most 20,000 dofs"):
        fi.System.from_matrices(wide, wide, wide, points={"tip": [1.0]})


def test_the_default_load_of_the_base_is_warned_of_where_dofs_turn():
    # of a clamped element of a beam: w and the turn at its free end, of which one moves with the base
    M, K = np.array([[156.0, -22.0], [-22.0, 4.0]]) / 420.0, np.array([[12.0, -6.0], [-6.0, 4.0]])
    with pytest.warns(fi.InputWarning, match=r"^base_load: .* that of dof 1 is negative") as caught:
        fi.System.from_matrices(M, 0.0 * M, K, points={"tip": [1.0, 0.0]})
    assert caught[0].filename == __file__
    # given, or of displacements alone, there is nothing to say
    fi.System.from_matrices(M, 0.0 * M, K, points={"tip": [1.0, 0.0]}, base_load=M @ [1.0, 0.0])
    fi.System.from_matrices(np.eye(2), np.zeros((2, 2)), K, points={"tip": [1.0, 0.0]})
