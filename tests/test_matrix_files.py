"""Matrices of other programs: files round trip through scipy and numpy, nodes give them pictures."""

import numpy as np
import pytest
import scipy.io
import scipy.sparse as sparse

import femimpact as fi

BEAM = fi.Beam.uniform(length=0.3, width=0.02, thickness=1.5e-3, young_modulus=70e9, density=2700.0)


@pytest.fixture
def assembled():
    return fi.assemble(fi.Structure(BEAM), elements=5)


@pytest.mark.parametrize("form", ["mtx", "mtx.gz", "sparse.npz", "one.npz", "several.npz"])
def test_a_matrix_comes_back_from_its_file(assembled, tmp_path, form):
    path, name = tmp_path / f"K.{form}", None
    if "mtx" in form:
        scipy.io.mmwrite(str(path.with_suffix("") if form == "mtx.gz" else path), sparse.coo_array(assembled.K))
        if form == "mtx.gz":
            import gzip

            path.write_bytes(gzip.compress(path.with_suffix("").read_bytes()))
    elif form == "sparse.npz":
        sparse.save_npz(path, sparse.csr_array(assembled.K))
    else:
        arrays = {"K": assembled.K.toarray()} | ({"other": np.zeros(3)} if form == "several.npz" else {})
        np.savez(path, **arrays)
        name = "K" if form == "several.npz" else None
    found = fi.system.read_matrix(path, name)
    # Matrix Market holds decimal digits
    assert abs(found - assembled.K).max() <= 1e-14 * abs(assembled.K).max()


def test_the_matrices_of_a_beam_give_the_beam_again(assembled, tmp_path):
    for name in "MCK":
        sparse.save_npz(tmp_path / f"{name}.npz", sparse.csr_array(getattr(assembled, name)))
    M, C, K = (fi.system.read_matrix(tmp_path / f"{name}.npz") for name in "MCK")
    points = {"tip": assembled.point_row("tip")}
    again = fi.System.from_matrices(
        M, C, K, points=points, base_load=assembled.base_load, nodes=assembled.nodes, expansion=assembled.expansion
    )
    one, other = (fi.solve_modes(system, 3) for system in (assembled, again))
    np.testing.assert_allclose(other.natural_frequency, one.natural_frequency, rtol=1e-9)
    assert again.points["tip"] == pytest.approx(0.3, abs=1e-15)
    # curves between the nodes are those of the elements
    rows = [system.deflection_rows([0.123])[0] for system in (assembled, again)]
    np.testing.assert_allclose(rows[1], rows[0], rtol=0, atol=1e-13)


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ({"nodes": [0.0, 1.0]}, "must be given with expansion"),
        ({"nodes": [1.0, 0.0], "expansion": np.zeros((4, 1))}, "increasing positions"),
        ({"nodes": [0.0, 1.0], "expansion": np.zeros((3, 1))}, r"must have the shape \(4, 1\)"),
    ],
)
def test_nodes_that_do_not_fit_are_refused(more, words):
    with pytest.raises(fi.InputError, match=words):
        fi.System.from_matrices([[1.0]], [[0.0]], [[1.0]], points={"tip": [1.0]}, **more)


@pytest.mark.parametrize("content", [b"", b"%%MatrixMarket nonsense", b"PK\x03\x04 damaged"])
@pytest.mark.parametrize("name", ["K.mtx", "K.npz"])
def test_damaged_files_are_one_line(tmp_path, content, name):
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(fi.InputError) as caught:
        fi.system.read_matrix(path)
    assert len(str(caught.value).splitlines()) == 1
    assert name in str(caught.value)


def test_objects_are_not_unpickled(tmp_path):
    np.savez(tmp_path / "K.npz", K=np.array([[{}]], dtype=object))
    with pytest.raises(fi.InputError, match="must be a readable matrix file"):
        fi.system.read_matrix(tmp_path / "K.npz")
