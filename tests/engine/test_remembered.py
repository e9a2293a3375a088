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
