"""Who follows jobs, on an event loop of the test's; the jobs are a stand-in."""

import asyncio

import pytest
from ridetune.app.jobs.followers import Followers

from ..loop import in_a_loop

PATIENCE = 5.0


class NoJobs:
    def standing(self, some):
        return {}


@pytest.mark.parametrize("turns", range(4))
def test_nobody_looks_any_more_once_the_last_follower_has_left(turns):
    """However few turns of the loop after news, which the looker is about to look at then."""

    async def follow_and_leave() -> int:
        followers = Followers(NoJobs())
        looks = followers.looks("job")
        await anext(looks)
        followers.wake("job")
        for _ in range(turns):
            await asyncio.sleep(0)
        await looks.aclose()
        if others := asyncio.all_tasks() - {asyncio.current_task()}:
            await asyncio.wait(others, timeout=PATIENCE)
        return len(asyncio.all_tasks()) - 1

    assert in_a_loop(follow_and_leave) == 0
