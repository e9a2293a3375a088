import threading
from concurrent.futures import ThreadPoolExecutor

import pytest
from ridetune.engine.remembered import Remembered


def test_the_least_recently_used_is_forgotten_when_the_sizes_are_too_many():
    """Oracle: 3 + 3 fit into 6, a third does not; a key that was asked for is the more recent."""
    kept = Remembered(6)
    kept.keep("a", "A", 3)
    kept.keep("b", "B", 3)
    assert kept.get("a") == "A"
    kept.keep("c", "C", 3)
    assert [kept.get(key) for key in "abc"] == ["A", None, "C"]


def test_one_that_is_too_large_alone_is_kept_alone():
    kept = Remembered(6)
    kept.keep("small", 1, 1)
    kept.keep("large", 2, 100)
    assert (kept.get("small"), kept.get("large")) == (None, 2)


def test_a_key_kept_again_holds_the_last_thing_and_counts_once():
    kept = Remembered(6)
    kept.keep("a", 1, 5)
    kept.keep("a", 2, 5)
    kept.keep("b", 3, 1)
    assert (kept.get("a"), kept.get("b")) == (2, 3)


def test_a_thing_is_made_once_for_all_who_ask_meanwhile():
    """Oracle: how often it was made; the maker waits for the one who asks for another key."""
    kept, made, go = Remembered(6), [], threading.Event()

    def make():
        go.wait(10)
        made.append("A")
        return "A"

    with ThreadPoolExecutor(4) as pool:
        asked = [pool.submit(kept.made, "a", make, len) for _ in range(4)]
        assert kept.made("b", lambda: "B", len) == "B"
        go.set()
        assert [one.result() for one in asked] == ["A"] * 4
    assert made == ["A"]
    assert kept.get("a") == "A"


def test_an_error_is_raised_and_not_kept():
    kept = Remembered(6)
    with pytest.raises(ZeroDivisionError):
        kept.made("a", lambda: 1 // 0, abs)
    assert kept.made("a", lambda: 2, abs) == 2
