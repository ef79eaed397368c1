"""Histories in pieces: the same numbers as in one, in the memory of a piece; and runs side by side."""

from __future__ import annotations

import dataclasses
import threading
import tracemalloc

import numpy as np
import pytest
import xarray
from builders import history_writer, reduced, with_ball

import femimpact as fi

pytestmark = pytest.mark.impacts

BASE = fi.Sine(amplitude=0.2037e-3, frequency=5.2)
METHOD = fi.Newmark(1e-4)
START = fi.State(ball_velocity=[0.1])


def _run(system, duration=0.5, method=METHOD, **record):
    return fi.integrate(system, BASE, method, duration, fi.Recorder(**record), initial=START)


def _streamed(system, piece_samples, **more):
    pieces = []
    response = _run(system, sink=pieces.append, piece_samples=piece_samples, **more)
    return response, pieces


def _columns(table):
    """Arrays of a record by their names, the work of each drive among them."""
    columns = {item.name: getattr(table, item.name) for item in dataclasses.fields(table)}
    work_of = columns.pop("work_of", {})
    return columns | {f"work of {name}": values for name, values in work_of.items()}


def _assert_joined(pieces, whole):
    """Every array of the pieces, one behind the other, has the bits of the whole."""
    np.testing.assert_array_equal(np.concatenate([piece.time for piece in pieces]), whole.time)
    for name, values in whole.channels.items():
        np.testing.assert_array_equal(np.concatenate([piece.channels[name] for piece in pieces]), values)
    for part in ("energy", "snapshots"):
        if getattr(whole, part) is None:
            assert all(getattr(piece, part) is None for piece in pieces)
            continue
        for name, values in _columns(getattr(whole, part)).items():
            joined = np.concatenate([_columns(getattr(piece, part))[name] for piece in pieces])
            np.testing.assert_array_equal(joined, values)


METHODS = (METHOD, fi.Newmark(1e-4, contact="energy-consistent"), fi.Newmark(2e-4, refine=4), fi.HHT(1e-4))


@pytest.mark.parametrize("method", METHODS)
def test_pieces_hold_the_bits_of_the_whole_history(small, method):
    response, pieces = _streamed(small, 333, method=method, snapshots=50)
    whole = _run(small, method=method, snapshots=50)
    _assert_joined(pieces, whole)
    np.testing.assert_array_equal(response.impacts.time, whole.impacts.time)


@pytest.mark.parametrize(
    "base",
    [
        fi.RecordedBase(np.sin(np.arange(100) / 3.0), 4e-3),
        fi.PointForce("tip", fi.Sine(0.05, 5.1, phase=0.3)),
        fi.Sine(2e-4, 5.0) + fi.HammerBlow("mid", 1e-3, 0.01, 0.1),
    ],
    ids=["recorded", "force", "drives"],
)
def test_pieces_hold_the_bits_whatever_drives(small, base):
    pieces = []
    record = fi.Recorder(("tip", "ball", "ball.gap", "tip.velocity"), sink=pieces.append, piece_samples=450)
    fi.integrate(small, base, METHOD, 0.5, record, initial=START)
    _assert_joined(
        pieces, fi.integrate(small, base, METHOD, 0.5, dataclasses.replace(record, sink=None), initial=START)
    )


@pytest.mark.parametrize("case", ["physical", "rigid", "stop"])
def test_pieces_hold_the_bits_in_physical_space_with_rigid_balls_and_with_stops(system, reference, case):
    method, channels = METHOD, None
    if case == "physical":
        chosen = system
    elif case == "rigid":
        rigid = with_ball(reference, contact=fi.Rigid(restitution=0.0))
        chosen, method = fi.assemble(rigid, elements=4), fi.MoreauJean(1e-4)
    else:
        # a stop's force along its direction has the other sign on the beam
        stop = fi.Stop("wall", at="tip", gap=1e-4, contact=fi.KelvinVoigt(restitution=0.6, contact_time=2e-3))
        chosen = fi.assemble(dataclasses.replace(reference, impactors=[], stops=[stop]), elements=4)
        channels = ("wall.contact_force", "tip")
    start = None if case == "stop" else START
    pieces = []
    record = fi.Recorder(channels, snapshots=70, sink=pieces.append, piece_samples=500)
    response = fi.integrate(chosen, BASE, method, 0.5, record, initial=start)
    whole = fi.integrate(chosen, BASE, method, 0.5, fi.Recorder(channels, snapshots=70), initial=start)
    assert max(np.abs(piece.channels[next(iter(piece.channels))]).max() for piece in pieces) > 0.0
    _assert_joined(pieces, whole)
    np.testing.assert_array_equal(response.sticking.start, whole.sticking.start)


@pytest.mark.parametrize(
    ("piece", "record"),
    [
        (1, {"every": 50}),
        (1, {"every": 1, "snapshots": 3}),
        (7, {"every": 3, "start": 0.1003}),
        (7, {"every": 3, "snapshots": 40, "start": 0.3, "snapshots_start": 0.05}),
        (100, {"every": 1, "snapshots": 1, "snapshots_start": 0.2}),
        (5001, {}),
        (10**6, {}),
        (64, {"channels": ("tip",), "ledger": False}),
        (64, {"channels": (), "start": 99.0, "snapshots": 64}),
    ],
)
def test_every_stride_and_start_gives_the_same_samples_in_pieces(small, piece, record):
    response, pieces = _streamed(small, piece, **record)
    whole = _run(small, **record)
    _assert_joined(pieces, whole)
    assert all(part.time.size + (part.snapshots.time.size if part.snapshots else 0) > 0 for part in pieces)
    assert max(part.time.size for part in pieces) <= piece
    assert response.streamed_to == whole.time[-1]


def test_pieces_arrive_while_the_run_goes_on(small):
    told = []
    record = fi.Recorder(sink=lambda piece: told.append(piece.time[-1]), piece_samples=2000)
    fi.integrate(small, BASE, METHOD, 0.5, record, progress=lambda share: told.append(0.5 * share))
    # whoever speaks says how far the run has come: first the progress, then the piece that is complete
    assert told == pytest.approx([0.1999, 0.1999, 0.3999, 0.3999, 0.5, 0.5], rel=1e-12)


def test_what_a_streamed_response_still_tells_is_the_same(small):
    response, _ = _streamed(small, 700, duration=3.0, impacts=5)
    whole = _run(small, duration=3.0, impacts=5)
    assert response.statistics == whole.statistics
    assert response.statistics_of == whole.statistics_of
    assert (response.warnings, response.notes, response.units) == (whole.warnings, whole.notes, whole.units)
    assert (response.window, response.regime.label) == (whole.window, whole.regime.label)
    assert (len(response.impacts), response.impacts.dropped) == (5, whole.impacts.dropped)
    for name, values in _columns(whole.steady).items():
        np.testing.assert_array_equal(_columns(response.steady)[name], values)


@pytest.mark.parametrize("piece", [7, 50, 1700, 10**5])
@pytest.mark.parametrize("start", [0.0, 0.2])
def test_the_energy_residual_is_that_of_the_whole_run_to_the_last_bit(small, piece, start):
    response, _ = _streamed(small, piece, start=start)
    whole = _run(small, start=start)
    assert response.energy.residual == whole.energy.residual > 0.0
    assert response.energy.time.size <= 4
    # what was lost by the end stands in the last row
    assert response.energy.contact_loss[-1] == whole.energy.contact_loss[-1]
    assert response.to_xarray().attrs == whole.to_xarray().attrs


def test_a_streamed_response_says_where_its_history_went(small):
    response, _ = _streamed(small, 1000, snapshots=100)
    assert (response.time.size, dict(response.channels), response.snapshots) == (0, {}, None)
    assert "streamed to 0.5 s" in repr(response)
    for read in (lambda: response["tip"], lambda: response.absolute("tip")):
        with pytest.raises(fi.InputError, match=r"tip.*Recorder\.sink"):
            read()


def test_pieces_are_read_only_and_keep_their_values(small):
    copies = []

    def sink(piece):
        copies.append((piece, {name: values.copy() for name, values in piece.channels.items()}))

    fi.integrate(small, BASE, METHOD, 0.3, fi.Recorder(("tip",), sink=sink, piece_samples=1, every=100, snapshots=100))
    for piece, channels in copies:
        np.testing.assert_array_equal(piece.channels["tip"], channels["tip"])
        arrays = [piece.time, *piece.channels.values(), *_columns(piece.energy).values()]
        assert not any(array.flags.writeable for array in [*arrays, *_columns(piece.snapshots).values()])
    # the buffer is filled again and again: what was handed over must not lie in it
    time = np.concatenate([piece.snapshots.time for piece, _ in copies])
    ball = np.concatenate([piece.snapshots.ball_displacement for piece, _ in copies])
    assert np.unique(time).size == np.unique(ball).size == 31


def _peak(system, duration):
    tracemalloc.start()
    try:
        _run(system, duration, sink=lambda piece: None, piece_samples=2000, impacts=100)
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def test_memory_does_not_grow_with_the_length_of_a_run(small):
    _peak(small, 0.5)
    short, long = _peak(small, 4.0), _peak(small, 40.0)
    cycles = 36.0 * BASE.frequency
    # statistics of base cycles: 13 numbers of 8 bytes each, doubled for what is read from them; the whole
    # history would be 360,000 samples of 18 numbers, 52 MB; the rest is what Python has not collected yet
    assert long - short < 2 * 13 * 8 * cycles + 100_000


def test_the_memory_limit_counts_one_piece(small):
    record = fi.Recorder(memory_limit=1e6, impacts=100)
    with pytest.raises(fi.InputError, match="sink"):
        fi.integrate(small, BASE, METHOD, 5.0, record)
    fi.integrate(small, BASE, METHOD, 5.0, dataclasses.replace(record, sink=lambda piece: None, piece_samples=1000))
    with pytest.raises(fi.InputError, match="memory_limit"):
        fi.integrate(small, BASE, METHOD, 5.0, dataclasses.replace(record, sink=lambda piece: None))


def test_a_recorded_motion_counts_at_every_step(small):
    base = fi.RecordedBase(np.sin(np.arange(100) / 3.0), 4e-3)
    record = fi.Recorder(every=100, impacts=10, memory_limit=1e5, sink=lambda piece: None, piece_samples=10)
    fi.integrate(small, BASE, METHOD, 2.0, record)
    # 20,001 values of 8 bytes
    with pytest.raises(fi.InputError, match="memory_limit"):
        fi.integrate(small, base, METHOD, 2.0, record)


def test_an_exception_in_the_sink_ends_the_run(small):
    pieces = []

    def sink(piece):
        pieces.append(piece)
        if len(pieces) == 3:
            raise OSError("disk full")

    with pytest.raises(OSError, match="disk full"):
        _run(small, sink=sink, piece_samples=100)
    assert len(pieces) == 3


def test_a_run_that_diverges_in_a_later_piece_says_when(reference):
    # the drive that the limit knows is small, the growth at resonance of an undamped beam is not
    bare = fi.without_impactors(fi.assemble(dataclasses.replace(reference, damping=None), elements=4))
    base, method = fi.Sine(1e-3, bare.first_frequency), fi.Newmark(1e-3, divergence_limit=1.001)
    pieces = []
    record = fi.Recorder(every=10, sink=pieces.append, piece_samples=100)
    with pytest.raises(fi.DivergenceError, match="t = ") as caught:
        fi.integrate(bare, base, method, 1000.0, record)
    named = float(str(caught.value).split("t = ")[1].split(" s")[0])
    # it is looked for at the ends of pieces, which take 1 s; four digits of the instant are printed
    assert len(pieces) > 1
    assert pieces[-1].time[-1] < named < pieces[-1].time[-1] + 1.1


def test_event_driven_runs_hand_over_whole_cycles(reference):
    rigid = reduced(with_ball(reference, contact=fi.Rigid(restitution=0.7)), 2, 8)
    pieces = []
    record = fi.Recorder(every=2, sink=pieces.append, piece_samples=100)
    streamed = fi.integrate(rigid, BASE, fi.EventDriven(), 4.0, record)
    whole = fi.integrate(rigid, BASE, fi.EventDriven(), 4.0, fi.Recorder(every=2))
    # 32 samples kept of a cycle: three of them in a piece
    assert max(piece.time.size for piece in pieces) <= 100
    np.testing.assert_array_equal(np.concatenate([piece.time for piece in pieces]), whole.time)
    assert streamed.streamed_to == whole.time[-1]
    # a motion divided in other places rounds otherwise, and impacts make that grow: the first ones only
    early = whole.time < 0.8
    tip = np.concatenate([piece.channels["tip"] for piece in pieces])
    np.testing.assert_allclose(tip[early], whole["tip"][early], atol=1e-9 * np.abs(whole["tip"]).max())
    assert streamed.energy.residual < 1e-11


# ---- on disk --------------------------------------------------------------------------------------


def test_a_written_history_is_the_dataset_of_the_whole_run(small, tmp_path):
    path = tmp_path / "history.nc"
    with history_writer(path) as sink:
        _run(small, every=3, sink=sink, piece_samples=321)
        assert not path.exists()
    whole = _run(small, every=3).to_xarray()
    with xarray.open_dataset(path, engine="h5netcdf") as written:
        xarray.testing.assert_equal(written.load(), whole)
        for name, values in whole.variables.items():
            assert written[name].attrs == values.attrs
        # the others are known at the end of a run only
        assert written.attrs.items() == {k: v for k, v in whole.attrs.items() if k.startswith("base_")}.items()
    assert [file.name for file in tmp_path.iterdir()] == ["history.nc"]


def test_a_history_that_breaks_off_leaves_what_was_there(small, tmp_path):
    path = tmp_path / "history.nc"
    path.write_bytes(b"before")

    def broken(sink, piece):
        sink(piece)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt), history_writer(path) as sink:
        _run(small, sink=lambda piece: broken(sink, piece), piece_samples=100)
    assert path.read_bytes() == b"before"
    assert [file.name for file in tmp_path.iterdir()] == ["history.nc"]


def test_the_file_has_no_place_for_snapshots(small, tmp_path):
    with pytest.raises(fi.InputError, match=r"record\.snapshots"), history_writer(tmp_path / "history.nc") as sink:
        _run(small, sink=sink, snapshots=10)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("second", [("tip",), ("tip", "tip.velocity")])
def test_a_writer_takes_the_pieces_of_one_run_only(small, tmp_path, second):
    method, base = fi.Newmark(1e-4), fi.Sine(1e-4, 5.0)
    with history_writer(tmp_path / "history.nc") as sink:
        fi.integrate(small, base, method, 0.05, fi.Recorder("tip", sink=sink))
        with pytest.raises(fi.InputError, match="pieces of one run"):
            fi.integrate(small, base, method, 0.05, fi.Recorder(second, sink=sink))


@pytest.mark.parametrize("place", ["missing/history.nc", "."])
def test_a_writer_says_where_it_cannot_write(tmp_path, place):
    with pytest.raises(fi.InputError, match=r"path = .*must be"), history_writer(tmp_path / place):
        pass


# ---- several runs ---------------------------------------------------------------------------------

SEVERAL = [fi.Sine(0.2037e-3, f) for f in (4.8, 5.0, 5.2, 5.4, 5.6)]


@pytest.mark.parametrize("threads", [None, 1, 2, 7])
def test_several_runs_are_those_of_one_call_each_to_the_last_bit(small, threads):
    responses = fi.integrate(small, SEVERAL, METHOD, 0.5, initial=START, threads=threads)
    assert isinstance(responses, tuple)
    for base, response in zip(SEVERAL, responses, strict=True):
        alone = fi.integrate(small, base, METHOD, 0.5, initial=START)
        assert response.base == base
        for name, values in alone.channels.items():
            np.testing.assert_array_equal(response[name], values)
        assert response.energy.residual == alone.energy.residual


def test_event_driven_runs_go_side_by_side_too(reference):
    rigid = reduced(with_ball(reference, contact=fi.Rigid(restitution=0.7)), 3, 8)
    one, two = (fi.integrate(rigid, SEVERAL, fi.EventDriven(), 5.0, threads=threads) for threads in (1, 2))
    for a, b in zip(one, two, strict=True):
        np.testing.assert_array_equal(a.impacts.time, b.impacts.time)
        np.testing.assert_array_equal(a["tip"], b["tip"])


def test_a_sequence_of_one_is_a_tuple_of_one(small):
    (response,) = fi.integrate(small, (BASE,), METHOD, 0.01, initial=START)
    assert isinstance(response, fi.response.Response)


def test_of_several_that_diverge_the_first_is_named_whatever_the_threads(reference):
    bare = fi.without_impactors(fi.assemble(dataclasses.replace(reference, damping=None), elements=4))
    # undamped, the first does not grow; the second takes longer to its limit than the third
    bases = [fi.Sine(1e-3, f * bare.first_frequency) for f in (0.5, 1.0001, 1.0, 0.5)]
    method = fi.Newmark(1e-3, divergence_limit=1.001)
    messages = set()
    for threads in (1, 2, 4):
        with pytest.raises(fi.DivergenceError) as caught:
            fi.integrate(bare, bases, method, 1000.0, fi.Recorder(every=100), threads=threads)
        messages.add(str(caught.value))
    assert len(messages) == 1
    assert f"{bases[1].frequency:g} Hz" in messages.pop()


def test_a_failing_run_does_not_keep_the_others_going(small):
    seen, before = [], threading.active_count()

    def progress(share):
        seen.append(share)
        if len(seen) == 8:
            raise OSError("nobody listens")

    with pytest.raises(OSError, match="nobody listens"):
        fi.integrate(small, SEVERAL * 4, METHOD, 60.0, fi.Recorder(every=1000), progress=progress, threads=2)
    # 20 runs of some pieces each would have told far more often
    assert max(seen) < 0.9
    assert threading.active_count() == before


def test_progress_of_several_runs_to_one(small):
    shares = []
    fi.integrate(small, SEVERAL, METHOD, 0.2, progress=shares.append, threads=2)
    assert shares == sorted(shares)
    # a sum of shares, rounded
    assert shares[-1] == pytest.approx(1.0, rel=1e-12)


# ---- wrong kinds ----------------------------------------------------------------------------------


def test_one_place_an_array_of_places_and_whole_floats_will_do(small):
    assert fi.Recorder(0.1).channels == (0.1,)
    assert fi.Recorder(np.array([0.1, 0.2])).channels == (0.1, 0.2)
    response = _run(small, channels="tip", every=10.0, snapshots=100.0, impacts=10.0, start=1e300)
    assert response.time.tolist() == [0.5]
