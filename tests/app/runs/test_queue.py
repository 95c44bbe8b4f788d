"""The queue of uploads: its length, and what those beyond it are told."""

from __future__ import annotations

import threading

import anyio
import pytest

from app.errors import TooManyUploads
from app.runs.queue import ReadingQueue


def test_upload_beyond_the_queue_is_refused_and_those_in_it_are_read() -> None:
    """One is read, two wait, and the fourth is told a time; afterwards there is room again."""
    release = threading.Event()
    read: list[int] = []

    def reading(number: int) -> None:
        """A reading that takes as long as the test says."""
        assert release.wait(30.0)
        read.append(number)

    async def load() -> None:
        """Three uploads one after the other, then a fourth."""
        queue = ReadingQueue(readers=1, most_waiting=2)
        async with anyio.create_task_group() as group:
            for number in range(3):
                queue.check()
                group.start_soon(queue.run, reading, number)
                await anyio.wait_all_tasks_blocked()
            with pytest.raises(TooManyUploads, match="2 uploads are waiting to be read") as caught:
                queue.check()
            assert 1.0 <= caught.value.retry_after_s <= 60.0
            release.set()
        queue.check()
        await queue.run(reading, 4)

    anyio.run(load)

    assert read == [0, 1, 2, 4]


def test_time_to_come_back_follows_the_time_of_a_reading() -> None:
    """Ten readings of 0.3 s let the mean rise, and fifty that wait make 11 s."""

    async def load() -> float:
        """Read, then fill the queue."""
        queue = ReadingQueue(readers=1, most_waiting=50)
        release = threading.Event()
        for _ in range(10):
            await queue.run(release.wait, 0.3)
        async with anyio.create_task_group() as group:
            for _ in range(51):
                group.start_soon(queue.run, release.wait, 30.0)
            await anyio.wait_all_tasks_blocked()
            with pytest.raises(TooManyUploads) as caught:
                queue.check()
            release.set()
        return caught.value.retry_after_s

    # Mean 0.3 - 0.2 * 0.9**10 = 0.23 s, fifty times; a busy machine is slower, never faster.
    assert anyio.run(load) >= 11.0
