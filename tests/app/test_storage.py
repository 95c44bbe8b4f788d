"""The data directory: private, locked, and swept of what nobody knows."""

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
    """A data directory that is ready."""
    made = Storage(tmp_path / "data", "bench")
    made.prepare()
    return made


def aged(path: Path) -> Path:
    """The same path, last changed a day ago."""
    past = time.time() - 86400
    os.utime(path, (past, past))
    return path


def test_data_directory_has_one_server(tmp_path: Path) -> None:
    """The second is refused while the first has it, and not afterwards."""
    first, second = (Storage(tmp_path, "bench") for _ in range(2))
    first.prepare()
    first.lock.take()

    with pytest.raises(OptionError, match="another server already uses"):
        second.lock.take()
    first.lock.release()
    second.lock.take()
    second.lock.release()


def test_servers_of_two_machines_may_share_a_directory(tmp_path: Path) -> None:
    """The lock is that of a machine; the leases in the database part the work."""
    first, second = (Storage(tmp_path, name) for name in ("one", "two"))
    first.prepare()
    second.prepare()
    first.lock.take()
    second.lock.take()

    assert first.incoming != second.incoming
    first.lock.release()
    second.lock.release()


def test_sweep_removes_what_no_row_names_and_nothing_else(storage: Storage) -> None:
    """Of known and unknown runs and fits, old and new, only the unknown old ones go."""
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


def test_uploads_of_a_server_that_is_gone_are_removed(storage: Storage) -> None:
    """At a start nothing can be coming in yet."""
    storage.new_incoming().write_bytes(b"half")

    storage.sweep_incoming()

    assert list(storage.incoming.iterdir()) == []


def test_uploads_of_a_container_that_is_gone_are_removed(tmp_path: Path) -> None:
    """Each container has a name of its own; the files of one that runs, and recent ones, stay."""
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
    """Someone named another database; the files are all that is left to go back with."""
    run, fit = new_id("run"), new_id("fit")
    storage.run(run).write_bytes(b"")
    storage.attempt(fit, 1).mkdir(parents=True)
    aged(storage.run(run))
    aged(storage.fit(fit))

    storage.sweep(set(), set(), now=time.time())

    assert storage.run(run).exists()
    assert storage.fit(fit).exists()


@pytest.mark.parametrize("text", ["../../victim", "..", "", "/etc", "fit_../../victim"])
def test_text_that_is_no_id_makes_no_path(storage: Storage, text: str) -> None:
    """Whatever row it stands in, nothing outside is touched."""
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
def test_attempt_that_is_no_number_makes_no_path(storage: Storage, attempt: int) -> None:
    """SQLite keeps a text in a column of numbers."""
    with pytest.raises(ValueError, match="no number of an attempt"):
        storage.remove_attempt(new_id("fit"), attempt)


def test_directory_that_cannot_be_made_is_named(tmp_path: Path) -> None:
    """A file stands where the directory should be."""
    (tmp_path / "file").write_text("")

    with pytest.raises(OptionError, match="data_dir: .*cannot be used"):
        Storage(tmp_path / "file" / "data", "bench").prepare()


@pytest.mark.parametrize("node", ["../../etc", "a/b", "..", "", "bench 4"])
def test_name_of_the_machine_cannot_leave_the_directory(tmp_path: Path, node: str) -> None:
    """A host name is set by someone else."""
    storage = Storage(tmp_path, node)

    assert storage.incoming.resolve().parent == (tmp_path / "incoming").resolve()


def test_place_is_the_same_at_each_start_and_another_in_another_directory(tmp_path: Path) -> None:
    """By it a server knows fits that a former one held, and leaves those of others alone."""
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
def test_lock_file_that_was_damaged_gets_a_new_name(tmp_path: Path, content: bytes) -> None:
    """The name is part of a path in the database, and the same at the start after that."""
    storage, again = (Storage(tmp_path, "bench") for _ in range(2))
    storage.prepare()
    (tmp_path / "nodes" / "bench.lock").write_bytes(content)
    storage.lock.take()

    assert re.fullmatch("bench-[0-9a-f]{16}", storage.place)
    storage.lock.release()
    assert again.place == storage.place


@pytest.mark.parametrize("make", [Path.mkdir, os.mkfifo])
def test_lock_that_is_no_file_is_named(tmp_path: Path, make: Callable[[Path], None]) -> None:
    """Nothing is waited for, and the operator may remove it."""
    storage = Storage(tmp_path, "bench")
    storage.prepare()
    make(tmp_path / "nodes" / "bench.lock")

    with pytest.raises(OptionError, match=r"bench\.lock .*it holds no data"):
        storage.lock.take()


def test_folders_in_the_place_of_files_are_swept(storage: Storage) -> None:
    """A file system that was repaired leaves such; the start goes on."""
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
    """Permissions alone say nothing about a full or a failing disk."""
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
def test_ids_are_known_by_their_form_and_never_repeat(kind: Kind) -> None:
    """130 random bits: a thousand of them are different."""
    made = {new_id(kind) for _ in range(1000)}

    assert len(made) == 1000
    assert all(is_id(kind, text) for text in made)


@pytest.mark.parametrize(
    "text", ["", "run", "run_", "run_" + "a" * 25, "run_" + "a" * 27, "run_" + "A" * 26,
             "fit_" + "a" * 26, "run_" + "a" * 25 + "\n", "run_" + "a" * 26 + "\n", "run_../" ]
)  # fmt: skip
def test_text_of_another_form_is_no_id(text: str) -> None:
    """One letter more or less, other letters, another kind, a line end."""
    assert not is_id("run", text)
