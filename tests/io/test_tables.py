"""Parquet, Zarr and SEP-005: what mbrs writes is read by pandas, pyarrow, xarray and sdypy-sep005 to the last bit."""

from __future__ import annotations

import mbrs as mb
import numpy as np
import pytest
from mbrs.errors import ModelError
from sweep_scenes import designs, frequency, model


def swept(n=7):
    return mb.sweep(model(), designs(n), frequency)


def test_runs_as_parquet(tmp_path):
    pandas, parquet = pytest.importorskip("pandas"), pytest.importorskip("pyarrow.parquet")
    runs = swept()
    path = runs.save(tmp_path / "runs.parquet")
    found, own = pandas.read_parquet(path), runs.to_frame()
    assert list(found.columns) == list(own.columns) and len(found) == 7
    for name in own.columns:
        assert np.array_equal(found[name].to_numpy(), own[name].to_numpy(), equal_nan=own[name].dtype.kind == "f")
    assert parquet.read_schema(path).metadata[b"mbrs result"] == b"Runs"
    table = designs(5)
    again = mb.design.from_table(table.save(tmp_path / "designs.parquet"))
    assert again.names == table.names and np.array_equal(again.values, table.values)
    (tmp_path / "bad.parquet").write_bytes(path.read_bytes()[:-40])
    with pytest.raises(ModelError, match=r"bad\.parquet is not a Parquet file"):
        mb.design.from_table(tmp_path / "bad.parquet")


def test_runs_and_transfer_functions_as_zarr(tmp_path):
    xarray = pytest.importorskip("xarray")
    pytest.importorskip("zarr")
    m = mb.examples.cubic_hexapod()
    h = mb.frf(m, "payload.force.z", ["payload.motion.z", "payload.motion.rx"], frequency=np.linspace(1.0, 30.0, 9))
    for thing in (swept(), h):
        path = thing.save(tmp_path / "data.zarr")  # the second one takes the place of the first
        found, own = xarray.open_zarr(path, consolidated=False), thing.to_xarray()
        assert set(found.variables) == set(own.variables)
        for name in own.variables:
            a, b = found[name].values, own[name].values
            assert np.array_equal(a.astype(b.dtype), b, equal_nan=b.dtype.kind in "fc")
            assert found[name].attrs.get("units") == own[name].attrs.get("units")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["data.zarr"]
    (tmp_path / "mine.zarr").mkdir()
    (tmp_path / "mine.zarr" / "notes.txt").write_text("mine")
    with pytest.raises(ModelError, match="is not a Zarr folder"):
        h.save(tmp_path / "mine.zarr")
    assert (tmp_path / "mine.zarr" / "notes.txt").read_text() == "mine"


def test_time_histories_as_sep_005():
    validator = pytest.importorskip("sdypy_sep005").Sep005Data
    m = mb.examples.cubic_hexapod()
    load = {m["payload"].force("z"): lambda t: np.sin(60.0 * t)}
    for t in (np.linspace(0.0, 0.3, 301), np.sort(np.r_[0.0, np.random.default_rng(3).random(20)])):
        y = mb.response(m, t=t, loads=load, outputs=["payload.motion.z", "payload.motion.rx"], kind="velocity")
        channels = mb.to_sep005(y)
        for c, row in zip(channels, y.value, strict=True):
            checked = validator.model_validate(c)
            assert checked.name == c["name"] and np.array_equal(np.asarray(checked.data), row)
        assert [c["unit_str"] for c in channels] == ["m/s", "rad/s"] and ("fs" in channels[0]) == (t.size == 301)
        again = mb.from_sep005(channels)
        assert [f.response for f in again.functions] == list(y.outputs)
        for f, row in zip(again.functions, y.value, strict=True):
            assert np.array_equal(f.value, row) and np.allclose(f.x, t, rtol=1e-14, atol=0) and f.quantity == "velocity"
        assert [c["name"] for c in mb.to_sep005(again)] == list(y.outputs)


BAD = [
    ({"data": [1.0]}, "channel 0 is not a dictionary"),
    ({"name": "a", "data": [1.0], "fs": 1.0}, "has no unit_str"),
    ({"name": "a", "data": [1.0], "unit_str": "m"}, "needs time, or fs above 0"),
    ({"name": "a", "data": [1.0, 2.0], "unit_str": "m", "time": [0.0]}, "has 2 values at 1 times"),
    ({"name": "a", "data": [[1.0]], "unit_str": "m", "fs": 1.0}, "one row of numbers"),
]


@pytest.mark.parametrize(("channel", "words"), BAD, ids=range(len(BAD)))
def test_channels_that_are_not_of_sep_005(channel, words):
    with pytest.raises(ModelError, match=words):
        mb.from_sep005([channel])
    with pytest.raises(ModelError, match="not a ModalResult"):
        mb.to_sep005(mb.modes(mb.examples.cubic_hexapod()))
