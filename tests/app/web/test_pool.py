"""The pools of the service: as wide as told, fair, and it refuses what piles up."""

import asyncio
import threading
from typing import Any

import pytest
from ridetune.app.errors import Busy, Unavailable
from ridetune.app.web.pool import Pool

from ..loop import in_a_loop


def pool_of(**told: Any) -> Pool:
    """One that takes much, one at a time, unless told otherwise."""
    return Pool("simulations", **({"width": 1, "share": 9, "most": 99, "at_once": 9} | told))


def test_no_more_runs_at_once_than_the_pool_is_wide():
    """Each job waits at a barrier of two: three at once would break it, fewer would hang."""
    pool = pool_of(width=2)
    lock, now, most = threading.Lock(), [0], [0]
    barrier = threading.Barrier(2, timeout=10)

    def work() -> None:
        with lock:
            now[0] += 1
            most[0] = max(most[0], now[0])
        barrier.wait()
        with lock:
            now[0] -= 1

    async def run() -> None:
        await asyncio.gather(*(pool.run(f"session {k}", work) for k in range(8)))

    in_a_loop(run)
    pool.close()
    assert most == [2]


def test_a_session_over_its_share_is_refused_and_free_again_afterwards():
    pool = pool_of(share=2)
    go = threading.Event()

    async def run() -> list:
        first = [asyncio.create_task(pool.run("greedy", lambda: go.wait(10))) for _ in range(2)]
        await asyncio.sleep(0)
        with pytest.raises(Busy) as refused:
            await pool.run("greedy", lambda: None)
        assert refused.value.headers == {"Retry-After": "1"}
        modest = asyncio.create_task(pool.run("modest", lambda: "served"))
        go.set()
        return [await modest, *await asyncio.gather(*first), await pool.run("greedy", lambda: 1)]

    assert in_a_loop(run) == ["served", True, True, 1]
    pool.close()


def test_a_full_queue_is_refused_at_once():
    pool = pool_of(most=1)
    go = threading.Event()

    async def run() -> None:
        first = asyncio.create_task(pool.run("one", lambda: go.wait(10)))
        await asyncio.sleep(0)
        with pytest.raises(Unavailable):
            await pool.run("two", lambda: None)
        go.set()
        await first

    in_a_loop(run)
    pool.close()


def test_who_is_refused_comes_back_when_there_is_room():
    """Functions took 5 s lately; two of them, one at a time, are done in 10 s."""
    now = [0.0]
    told = []
    pool = pool_of(most=2, worked=lambda *times: told.append(times), clock=lambda: now[0])
    go = threading.Event()

    def five_seconds() -> None:
        now[0] += 5

    async def run() -> str:
        for _ in range(50):
            await pool.run("before", five_seconds)
        first = [asyncio.create_task(pool.run("one", lambda: go.wait(10))) for _ in range(2)]
        await asyncio.sleep(0)
        with pytest.raises(Unavailable) as refused:
            await pool.run("two", lambda: None)
        go.set()
        await asyncio.gather(*first)
        return refused.value.headers["Retry-After"]

    assert in_a_loop(run) == "10"
    assert told[:50] == [(0.0, 5.0)] * 50
    pool.close()


def test_an_error_goes_to_its_caller_and_frees_the_place():
    pool = pool_of(share=1)

    async def run() -> None:
        for _ in range(3):
            with pytest.raises(ZeroDivisionError):
                await pool.run("session", lambda: 1 / 0)

    in_a_loop(run)
    pool.close()


def test_a_session_waits_for_its_turn_while_others_run():
    """Two of the greedy one's never run together; the modest one's runs beside the first."""
    pool = pool_of(width=2, at_once=1)
    meet = threading.Barrier(2, timeout=10)
    lock = threading.Lock()

    def work() -> None:
        assert lock.acquire(blocking=False)
        lock.release()

    def first() -> None:
        with lock:
            meet.wait()

    async def run() -> None:
        await asyncio.gather(
            pool.run("greedy", first),
            *(pool.run("greedy", work) for _ in range(3)),
            pool.run("modest", meet.wait),
        )

    in_a_loop(run)
    pool.close()


def test_what_nobody_waits_for_any_more_is_under_way_until_it_ends():
    """Else one who asks and hangs up, again and again, would have more than a share of the pool."""
    pool = pool_of(width=2, share=1)
    begun, go = threading.Semaphore(0), threading.Event()

    def hold() -> None:
        begun.release()
        assert go.wait(10)

    async def run() -> None:
        first = asyncio.create_task(pool.run("greedy", hold))
        assert await asyncio.to_thread(begun.acquire, timeout=10)
        first.cancel()
        with pytest.raises(asyncio.CancelledError):
            await first
        with pytest.raises(Busy):
            await pool.run("greedy", hold)
        go.set()
        while pool.under_way:
            await asyncio.sleep(0.01)
        await pool.run("greedy", hold)

    in_a_loop(run)
    pool.close()


def test_what_waits_and_nobody_waits_for_is_dropped():
    """Be it for a thread, or for a turn of its session."""
    pool = pool_of(at_once=1)
    begun, go, ran = threading.Event(), threading.Event(), []

    def hold() -> None:
        begun.set()
        assert go.wait(10)

    async def run() -> None:
        first = asyncio.create_task(pool.run("one", hold))
        assert await asyncio.to_thread(begun.wait, 10)
        late = [
            asyncio.create_task(pool.run(name, lambda: ran.append(1))) for name in ("one", "two")
        ]
        await asyncio.sleep(0.01)
        assert pool.under_way == 3
        for one in late:
            one.cancel()
        await asyncio.wait(late)
        await asyncio.sleep(0.01)
        assert pool.under_way == 1
        go.set()
        await first
        assert await pool.run("two", lambda: "served") == "served"

    in_a_loop(run)
    pool.close()
    assert ran == []
