"""Reading and writing files: regular ones, completely or not at all, no rest behind."""

import os
import socket
import stat

import pytest

from stickslip.errors import InputError
from stickslip.io import files


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """A folder with one file of each kind, in which the commands run."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").write_bytes(b"old")
    (tmp_path / "kept").write_bytes(b"old")
    (tmp_path / "kept").chmod(0o444)
    (tmp_path / "folder").mkdir()
    os.mkfifo("pipe")
    with socket.socket(socket.AF_UNIX) as ears:
        ears.bind("socket")
        os.symlink("/dev/null", "to-device")
        os.symlink("pipe", "to-pipe")
        os.symlink("kept", "to-kept")
        os.symlink("loop", "loop")
        yield tmp_path


THINGS = [
    ("folder", "is a directory"),
    ("pipe", "is a named pipe"),
    ("socket", "is a socket"),
    ("/dev/null", "is a device"),
    ("/dev/zero", "is a device"),
    ("to-device", "is a device"),
    ("to-pipe", "is a named pipe"),
    ("loop", "Too many levels of symbolic links"),
    ("a\0b", "null"),
    ("x" * 300, "File name too long"),
    ("file/below", "Not a directory"),
]


@pytest.mark.parametrize(
    ("place", "words"),
    [
        *THINGS,
        ("kept", "is read-only"),
        ("to-kept", "is read-only"),
        ("none/file", "no directory .*; make it first"),
    ],
)
def test_only_a_regular_file_is_replaced(place, words):
    before = {name: os.lstat(name) for name in os.listdir()}
    with pytest.raises(InputError, match=words) as caught:
        files.write(place, b"new")
    assert str(caught.value).startswith(place.replace("\0", "\ufffd") + ": ")
    assert {name: os.lstat(name) for name in os.listdir()} == before


@pytest.mark.parametrize(("place", "words"), [*THINGS, ("none", "no such file")])
def test_only_a_regular_file_is_read(place, words):
    with pytest.raises(InputError, match=words):
        files.read(place, "trace", largest=10)


def test_a_file_larger_than_allowed_is_not_read_and_one_of_the_kernel_is_empty():
    assert files.read("file", "trace", largest=3) == b"old"
    message = r"^file: has 3e-06 MB, more than a trace may have \(2e-06 MB\)$"
    with pytest.raises(InputError, match=message):
        files.read("file", "trace", largest=2)
    assert files.read("/proc/kmsg", "trace", largest=3) == b""


@pytest.mark.parametrize("link", ["to-file", "to-new"])
def test_a_link_stays_and_what_it_leads_to_is_written(folder, link):
    place = link.removeprefix("to-")
    os.symlink(place, link)
    files.write(link, b"new")
    assert os.readlink(link) == place
    assert (folder / place).read_bytes() == b"new"


def test_a_file_that_is_replaced_keeps_its_permissions_and_a_hard_link_what_it_had(
    folder,
):
    os.chmod("file", 0o640)
    os.link("file", "other")
    files.write("file", b"new")
    assert stat.S_IMODE(os.stat("file").st_mode) == 0o640
    assert (folder / "other").read_bytes() == b"old"
