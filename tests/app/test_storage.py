"""Data directory: permissions, lock, and removal of files without a row."""

from __future__ import annotations

import os
import re
import resource
import signal
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from app.identifiers import Kind, is_id, new_id
from app.storage import Storage
from identification.errors import OptionError


@pytest.fixture
def storage(tmp_path: Path) -> Storage:
    """Prepared data directory."""
    made = Storage(tmp_path / "data", "bench")
    made.prepare()
    return made


def aged(path: Path) -> Path:
    """Set the modification time of a path to a day ago and return the path."""
    past = time.time() - 86400
    os.utime(path, (past, past))
    return path


def test_data_directory_has_one_server(tmp_path: Path) -> None:
    """A second server is rejected until the first has released the lock."""
    first, second = (Storage(tmp_path, "bench") for _ in range(2))
    first.prepare()
    first.lock.take()

    with pytest.raises(OptionError, match="another server already uses"):
        second.lock.take()
    first.lock.release()
    second.lock.take()
    second.lock.release()


def test_servers_of_two_machines_may_share_a_directory(tmp_path: Path) -> None:
    """Each machine has its own lock; leases in the database divide the work."""
    first, second = (Storage(tmp_path, name) for name in ("one", "two"))
    first.prepare()
    second.prepare()
    first.lock.take()
    second.lock.take()

    assert first.incoming != second.incoming
    first.lock.release()
    second.lock.release()


def test_sweep_removes_only_old_files_without_a_row(storage: Storage) -> None:
    """Known, recent and foreign files are kept."""
    runs = [new_id("run") for _ in range(3)]
    fits = [new_id("fit") for _ in range(2)]
    for run in runs:
        storage.run(run).write_bytes(b"")
    for fit in fits:
        storage.attempt(fit, 1).mkdir(parents=True)
    known_run, old_run, new_run = runs
    known_fit, old_fit = fits
    for path in (storage.run(known_run), storage.run(old_run), *map(storage.fit, fits)):
        aged(path)
    foreign = storage.directory / "runs" / "README"
    foreign.write_text("put here by someone")
    aged(foreign)
    removed = storage.sweep({known_run}, {known_fit}, time.time())

    assert removed == 2
    assert storage.run(known_run).exists()
    assert storage.run(new_run).exists()
    assert not storage.run(old_run).exists()
    assert storage.fit(known_fit).exists()
    assert not storage.fit(old_fit).exists()
    assert foreign.exists()


def test_start_removes_uploads_of_an_earlier_server(storage: Storage) -> None:
    """No upload can be in progress at the start."""
    storage.new_incoming().write_bytes(b"half")

    storage.sweep_incoming()

    assert list(storage.incoming.iterdir()) == []


def test_sweep_removes_old_uploads_of_ended_containers(tmp_path: Path) -> None:
    """Each container has another name; uploads of running ones and recent uploads are kept."""
    gone, running, own = (Storage(tmp_path, name) for name in ("gone", "running", "own"))
    for storage in (gone, running, own):
        storage.prepare()
        storage.lock.take()
    files = [storage.new_incoming() for storage in (gone, gone, running, own)]
    for file in files:
        file.write_bytes(b"half of a ru")
    for file in (files[0], *files[2:]):
        aged(file)
    gone.lock.release()

    removed = own.sweep(set(), set(), time.time())
    for storage in (running, own):
        storage.lock.release()

    assert removed == 1
    assert [file.exists() for file in files] == [False, True, True, True]


def test_nothing_is_swept_under_an_empty_database(storage: Storage) -> None:
    """An empty database indicates a wrong URL; the files may be the only remaining data."""
    run, fit = new_id("run"), new_id("fit")
    storage.run(run).write_bytes(b"")
    storage.attempt(fit, 1).mkdir(parents=True)
    aged(storage.run(run))
    aged(storage.fit(fit))

    storage.sweep(set(), set(), now=time.time())

    assert storage.run(run).exists()
    assert storage.fit(fit).exists()


@pytest.mark.parametrize("text", ["../../victim", "..", "", "/etc", "fit_../../victim"])
def test_invalid_id_gives_no_path(storage: Storage, text: str) -> None:
    """No function accepts a text that could point outside the data directory."""
    victim = storage.directory.parent / "victim"
    victim.mkdir()

    for use in (storage.run, storage.fit, storage.remove_run, storage.remove_fit,
                storage.remove_checkpoints):  # fmt: skip
        with pytest.raises(ValueError, match="is no id of a"):
            use(text)
    with pytest.raises(ValueError, match="is no id of a"):
        storage.keep_attempt(text, 1)

    assert victim.is_dir()
    assert storage.directory.is_dir()


@pytest.mark.parametrize("attempt", [-1, "../../.."])
def test_invalid_attempt_gives_no_path(storage: Storage, attempt: int) -> None:
    """SQLite can store a text in an integer column."""
    with pytest.raises(ValueError, match="no number of an attempt"):
        storage.remove_attempt(new_id("fit"), attempt)


def test_unusable_data_directory_is_named(tmp_path: Path) -> None:
    """The parent of the data directory is a file."""
    (tmp_path / "file").write_text("")

    with pytest.raises(OptionError, match="data_dir: .*cannot be used"):
        Storage(tmp_path / "file" / "data", "bench").prepare()


@pytest.mark.parametrize("node", ["../../etc", "a/b", "..", "", "bench 4"])
def test_name_of_the_machine_cannot_leave_the_directory(tmp_path: Path, node: str) -> None:
    """A host name is untrusted input."""
    storage = Storage(tmp_path, node)

    assert storage.incoming.resolve().parent == (tmp_path / "incoming").resolve()


def test_place_is_stable_and_unique_per_directory(tmp_path: Path) -> None:
    """A server takes over the fits held under its own place only."""
    places = []
    for directory in ("a", "a", "b"):
        storage = Storage(tmp_path / directory, "bench")
        storage.prepare()
        storage.lock.take()
        places.append(storage.place)
        storage.lock.release()

    assert places[0] == places[1] != places[2]
    assert all(place.startswith("bench-") and "/" not in place for place in places)


@pytest.mark.parametrize("content", [b"", b"\xff\xfe\x00", b"not a name", b"a" * 10_000])
def test_damaged_lock_file_gets_a_new_identifier(tmp_path: Path, content: bytes) -> None:
    """The new identifier is valid and remains the same at the next start."""
    storage, again = (Storage(tmp_path, "bench") for _ in range(2))
    storage.prepare()
    (tmp_path / "nodes" / "bench.lock").write_bytes(content)
    storage.lock.take()

    assert re.fullmatch("bench-[0-9a-f]{16}", storage.place)
    storage.lock.release()
    assert again.place == storage.place


@pytest.mark.parametrize("make", [Path.mkdir, os.mkfifo])
def test_lock_that_is_no_regular_file_is_refused(
    tmp_path: Path, make: Callable[[Path], None]
) -> None:
    """Opening it does not block; the message states that it can be removed."""
    storage = Storage(tmp_path, "bench")
    storage.prepare()
    make(tmp_path / "nodes" / "bench.lock")

    with pytest.raises(OptionError, match=r"bench\.lock .*it holds no data"):
        storage.lock.take()


def test_directories_in_place_of_files_are_swept(storage: Storage) -> None:
    """A file system repair can leave such entries; they must not prevent the start."""
    (storage.new_incoming() / "below").mkdir(parents=True)
    run, fit = new_id("run"), new_id("fit")
    storage.run(run).mkdir()
    storage.fit(fit).write_bytes(b"")
    for path in (storage.run(run), storage.fit(fit)):
        aged(path)

    storage.sweep_incoming()

    assert list(storage.incoming.iterdir()) == []
    assert storage.sweep({new_id("run")}, set(), time.time()) == 2
    assert not storage.run(run).exists()
    assert not storage.fit(fit).exists()


def test_directory_is_writable_only_while_there_is_space(storage: Storage) -> None:
    """Permissions do not reveal a full or failing disk."""
    assert storage.is_writable()
    assert list(storage.incoming.iterdir()) == []
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, resource.RLIM_INFINITY))
    ignored = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    try:
        assert not storage.is_writable()
    finally:
        signal.signal(signal.SIGXFSZ, ignored)
        resource.setrlimit(resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))


@pytest.mark.parametrize("kind", ["run", "fit", "batch", "key"])
def test_ids_are_valid_and_unique(kind: Kind) -> None:
    """An ID has 130 random bits."""
    made = {new_id(kind) for _ in range(1000)}

    assert len(made) == 1000
    assert all(is_id(kind, text) for text in made)


@pytest.mark.parametrize(
    "text", ["", "run", "run_", "run_" + "a" * 25, "run_" + "a" * 27, "run_" + "A" * 26,
             "fit_" + "a" * 26, "run_" + "a" * 25 + "\n", "run_" + "a" * 26 + "\n", "run_../" ]
)  # fmt: skip
def test_text_of_another_form_is_no_valid_id(text: str) -> None:
    """Length, alphabet, kind and the absence of a line end are checked."""
    assert not is_id("run", text)
