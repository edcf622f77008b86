"""Files are hostile until they are read: damaged, huge, nested, with entities, from outside of the folder. Each is a named error, soon."""

from __future__ import annotations

import io
import subprocess
import sys
import zlib
from pathlib import Path

import hostile_files
import mbrs as mb
import numpy as np
import pytest
import scipy.io
from hostile_files import FOREIGN, OURS
from mbrs import formats
from mbrs.errors import ModelError
from mbrs.io import _matrices, _mjcf_parts, _xml, matlab, punch

HERE = Path(__file__).parent
NEEDS = {"urdf": "lxml", "xml": "lxml", "uff": "pyuff", "op4": "pyyeti", "pch": "pyyeti", "parquet": "pyarrow"}
ROBOT = '<robot name="r"><link name="a"/></robot>'


def need(kind):
    library = NEEDS.get(kind.split()[0])
    if library:
        pytest.importorskip(library, reason=f"pip install {library}")


@pytest.mark.parametrize("mutations", [50, pytest.param(300, marks=pytest.mark.slow)])
@pytest.mark.parametrize("kind", OURS)
def test_damaged_files_are_named_errors(kind, mutations, tmp_path):
    """Or a file that still can be read."""
    need(kind)
    fine, refused, wrong = hostile_files.run(kind, mutations, 11, tmp_path)
    assert not wrong, "\n".join(wrong)
    assert fine + refused == mutations and refused > mutations / 3


@pytest.mark.skipif(sys.platform == "win32", reason="limits of POSIX")
@pytest.mark.slow
@pytest.mark.parametrize("kind", FOREIGN)
def test_damaged_files_that_a_library_reads_are_named_errors(kind):
    """In a process of its own, with a limit of memory and of time."""
    need(kind)
    command = [sys.executable, str(HERE / "hostile_files.py"), kind, "300", "11"]
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=hostile_files.environment())
    assert done.returncode == 0 and done.stdout.rstrip().endswith("wrong 0"), done.stdout + done.stderr[-2000:]


@pytest.mark.parametrize("kind", [*OURS, *FOREIGN])
def test_samples_can_be_read(kind, tmp_path):
    """What is damaged above was whole before."""
    need(kind)
    path = tmp_path / f"a.{kind.split()[0]}"
    path.write_bytes(hostile_files.sample(kind))
    assert hostile_files.read(kind, path) is not None


LAUGHS = "".join(f'<!ENTITY l{i} "{f"&l{i - 1};" * 10}">' for i in range(1, 12))
ENTITIES = [
    f'<!DOCTYPE robot [<!ENTITY l0 "lol">{LAUGHS}]><robot name="&l11;"><link name="a"/></robot>',
    '<!DOCTYPE robot SYSTEM "http://127.0.0.1:9/x.dtd"><robot name="r"/>',
    '<!DOCTYPE r [<!ENTITY x SYSTEM "file:///etc/passwd">]><robot name="&x;"><link name="a"/></robot>',
    '<?xml version="1.0"?>\n<!doctype robot><robot name="r"/>',
]


@pytest.mark.parametrize("ending", [".urdf", ".xml"])
@pytest.mark.parametrize("text", ENTITIES)
@pytest.mark.parametrize("encoding", ["utf-8", "utf-16", "utf-7"])
def test_entities_and_document_types_are_refused(ending, text, encoding, tmp_path):
    need("urdf")
    path = tmp_path / f"a{ending}"
    head = "" if encoding == "utf-8" else f'<?xml version="1.0" encoding="{encoding}"?>'
    path.write_bytes((head + text.replace('<?xml version="1.0"?>', "")).encode(encoding))
    with pytest.raises(
        ModelError, match=r"is not read: it can name other files|is not UTF-8|is not XML|is not a file of"
    ):
        mb.Model.load(path)


def test_the_encoding_that_a_file_declares_is_not_believed(tmp_path):
    """UTF-7 hides the declaration from a search of bytes; read as UTF-8 it is no XML."""
    need("urdf")
    path = tmp_path / "a.urdf"
    path.write_bytes(b'<?xml version="1.0" encoding="utf-7"?>' + ROBOT.encode())
    assert repr(mb.Model.load(path)).startswith("Model('r'")
    path.write_bytes(b'<?xml version="1.0" encoding="utf-7"?>+ADwAIQ-DOCTYPE r><robot name="r"/>')
    with pytest.raises(ModelError):
        mb.Model.load(path)


def test_trees_and_texts_that_are_too_large(tmp_path, monkeypatch):
    need("urdf")
    path = tmp_path / "a.xml"
    path.write_text("<mujoco><worldbody>" + "<body>" * 100_000 + "</body>" * 100_000 + "</worldbody></mujoco>")
    with pytest.raises(ModelError, match=r"is not XML: .*depth"):
        mb.Model.load(path)
    path.write_text("<mujoco><worldbody>" + "<body>" * 200 + "</body>" * 200 + "</worldbody></mujoco>")
    assert mb.Model.load(path).bodies == []
    path = tmp_path / "a.urdf"
    path.write_text(ROBOT.replace('name="r"', f'name="{"x" * 100_000}"').replace("link", "lonk"))
    with pytest.raises(ModelError) as caught:
        mb.Model.load(path)
    assert len(str(caught.value)) < 500
    monkeypatch.setattr(_xml, "LARGEST_XML", 1024)
    with pytest.raises(ModelError, match="larger than 0 MiB, the largest file of its kind"):
        mb.Model.load(path)


def test_files_that_include_each_other_deeply(tmp_path, monkeypatch):
    need("xml")
    for i in range(30):
        (tmp_path / f"f{i}.xml").write_text(
            f'<mujocoinclude><worldbody/><include file="f{i + 1}.xml"/></mujocoinclude>'
        )
    (tmp_path / "a.xml").write_text('<mujoco><include file="f0.xml"/></mujoco>')
    with pytest.raises(ModelError, match="nested more than 16 files deep"):
        mb.Model.load(tmp_path / "a.xml")
    monkeypatch.setattr(_mjcf_parts, "_DEEPEST", 100)
    with pytest.raises(ModelError, match=r"f30\.xml: it does not exist"):
        mb.Model.load(tmp_path / "a.xml")


ABSENT = [f"absent.{ending}" for ending in ("urdf", "xml", "op4", "mtx", "mat", "uff", "pch")]


@pytest.mark.parametrize("name", ["folder.urdf", *ABSENT])
def test_files_that_are_not_there(name, tmp_path):
    need(name.rpartition(".")[2])
    (tmp_path / "folder.urdf").mkdir()
    read = (
        mb.load
        if name.endswith("uff")
        else mb.Model.load
        if name.endswith(("urdf", "xml"))
        else mb.MechanicalSystem.load
    )
    with pytest.raises(ModelError, match=r"cannot read .*: it (does not exist|is not a file)"):
        read(tmp_path / name)


@pytest.mark.parametrize("name", ["a", "a.", "a.foo", ".urdf", "a.URDFX", "x" * 200 + ".foo"])
def test_unknown_endings_list_the_known_ones(name, tmp_path):
    with pytest.raises(ModelError, match=r"known are \.toml, \.urdf, \.xml") as caught:
        mb.Model.load(tmp_path / name)
    assert len(str(caught.value)) < 400
    with pytest.raises(ModelError, match=r"known are \.toml, \.urdf$"):
        mb.Model("m").save(tmp_path / name)
    with pytest.raises(ModelError, match=r"known are \.mat, \.mtx, \.op4, \.pch"):
        mb.MechanicalSystem.load(tmp_path / name)


def test_endings_are_read_in_any_case(tmp_path):
    need("urdf")
    (tmp_path / "A.URDF").write_text(ROBOT)
    assert mb.Model.load(tmp_path / "A.URDF").name == "r"


def test_two_formats_of_one_ending_are_a_mistake():
    formats.known("model", "read")
    with pytest.raises(ValueError, match="belongs to URDF already"):
        formats.register(formats.Format(".urdf", "model", "another"))


def test_files_are_as_large_as_their_format_allows(tmp_path, monkeypatch):
    path = tmp_path / "a.mtx"
    scipy.io.mmwrite(path, np.eye(3))
    monkeypatch.setattr(formats.open_file, "__defaults__", (20,))
    assert formats.LARGEST_FILE == 256 * 1024**2
    with pytest.raises(ModelError, match=r"a\.mtx is larger than"):
        mb.MechanicalSystem.load({"M": path, "K": path})


def test_a_compressed_file_that_unpacks_without_end(tmp_path, monkeypatch):
    """A megabyte of zeros is a kilobyte; with the real limit it would be a gigabyte."""
    monkeypatch.setattr(matlab, "LARGEST_UNPACKED", 2**20)
    buffer = io.BytesIO()
    scipy.io.savemat(buffer, {"M": np.zeros((400, 400))}, do_compression=True)
    path = tmp_path / "a.mat"
    path.write_bytes(buffer.getvalue())
    assert len(zlib.compress(b"0" * 2**20)) > 100 and path.stat().st_size < 5000
    with pytest.raises(ModelError, match="unpacks to more than 1 MiB"):
        mb.MechanicalSystem.load(path)


@pytest.mark.parametrize(
    "text",
    [
        "%%MatrixMarket matrix array real general\n2000000000 2000000000\n1.0\n",
        "%%MatrixMarket matrix array real general\n4000000 4000000\n1.0\n",
        "%%MatrixMarket matrix coordinate real general\n3 3 999999999999\n1 1 1.0\n",
        "%%MatrixMarket matrix coordinate real general\n6000000 3 1\n1 1 1.0\n",
        "%%MatrixMarket matrix coordinate real general\n3 3 1\n9 1 1.0\n",
        "%%MatrixMarket matrix coordinate real general\n3 3 1\n1.5 1 1.0\n",
        "%%MatrixMarket matrix coordinate real symmetric\n3 2 1\n1 1 1.0\n",
        "%%MatrixMarket matrix coordinate quaternion general\n3 3 1\n1 1 1.0\n",
        "%%MatrixMarket vector\n",
        "",
    ],
)
def test_sizes_that_do_not_fit_the_file(tmp_path, text):
    path = tmp_path / "a.mtx"
    path.write_text(text)
    with pytest.raises(ModelError, match=r"^a\.mtx"):
        mb.MechanicalSystem.load({"M": path, "K": path})


def test_sides_of_matrices_have_a_limit(tmp_path, monkeypatch):
    for module in (_matrices, matlab):
        monkeypatch.setattr(module, "LARGEST_SIDE", 2)
    scipy.io.savemat(tmp_path / "a.mat", {"M": np.eye(3), "K": np.eye(3)})
    with pytest.raises(ModelError, match=r"matrix 'M' has the shape \(3, 3\)"):
        mb.MechanicalSystem.load(tmp_path / "a.mat")


def test_binary_op4_that_points_backwards(tmp_path):
    need("op4")
    path = tmp_path / "a.op4"
    good = hostile_files.sample("op4")
    for data in (good[:4] + b"\xf0\xff\xff\xff" + good[8:], good[:-5], good + b"1234", b"\x18\x00\x00\x00", b""):
        path.write_bytes(data)
        with pytest.raises(ModelError, match=r"a\.op4"):
            mb.MechanicalSystem.load(path)


def test_punch_files_name_few_nodes_and_include_nothing(tmp_path, monkeypatch):
    need("pch")
    path = tmp_path / "a.pch"
    good = hostile_files.sample("pch")
    (tmp_path / "other.bdf").write_bytes(good)
    path.write_bytes(b"INCLUDE 'other.bdf'\n")
    with pytest.raises(ModelError, match=r"a\.pch"):
        mb.MechanicalSystem.load(path)
    monkeypatch.setattr(punch, "_LARGEST", 2)
    path.write_bytes(good)
    with pytest.raises(ModelError, match="names more than 2 nodes"):
        mb.MechanicalSystem.load(path)


def test_results_are_never_unpickled(tmp_path):
    path = tmp_path / "a.pkl"
    path.write_bytes(b"cos\nsystem\n(S'touch /tmp/mbrs_was_here'\ntR.")
    with pytest.raises(ModelError, match="a pickle can run any program"):
        mb.load(path)
    assert not Path("/tmp/mbrs_was_here").exists()
