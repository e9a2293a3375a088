"""What a service for many users needs, out of what one session, move and job take.

    .venv/bin/ridetune bench --service -o bench.json
    .venv/bin/python docs/studies/growth.py bench.json

Prints the tables of docs/scaling.md. What users do is assumed (USE); what that takes was measured.
"""

import json
import sys
from collections.abc import Mapping
from pathlib import Path

USERS = (30, 1_000, 100_000)
ACTIVE = 0.1
"""Share of the users who tune at the same time, at the busiest hour."""

USE = {"moves": 3600.0, "fits": 2.0, "uploads": 6.0, "swept cars": 10_000.0, "sessions": 1.0}
"""By an active user, an hour. 3600 moves are six minutes of dragging at ten replies a second."""

KEPT = {"sessions": 3.0, "uploads": 50.0}
"""By every user, for good."""

BUSY = 0.5
"""Share of the cores, and of the replies that one process gives a second, that may be used at the
busiest hour: queues behind a busier one grow long."""

CONNECTIONS = 20
"""Of a service process to PostgreSQL, at most."""


def main(path: str) -> None:
    """Print both tables."""
    found = figures(json.loads(Path(path).read_text()))
    cost = {
        "moves": found["move", "processor"],
        "fits": found["identification-job", "processor"],
        "uploads": found["upload", "processor"],
        "swept cars": found["sweep-job", "processor of 1e6 cars"] / 1e6,
        "sessions": found["session", "processor"],
    }
    hourly = {name: USE[name] * cost[name] for name in USE}
    print("| an active user, an hour | | of a core, s |\n|---|---|---|")
    for name, seconds in hourly.items():
        print(f"| {name} | {USE[name]:g} | {seconds:.3g} |")
    print(f"| together | | {sum(hourly.values()):.3g} |\n")
    print("| users |" + "".join(f" {users:,} |" for users in USERS))
    print("|---|" + "---|" * len(USERS))
    rows = [needs(users, found, hourly) for users in USERS]
    for name in rows[0]:
        print(f"| {name} |" + "".join(f" {row[name]} |" for row in rows))


def needs(
    users: int,
    found: Mapping[tuple[str, str], float],
    hourly: Mapping[str, float],
) -> dict[str, str]:
    """What so many users need at the busiest hour."""
    active = ACTIVE * users
    interactive = hourly["moves"] + hourly["uploads"] + hourly["sessions"]
    moves = active * USE["moves"] / 3600.0
    processes = -(-moves // (BUSY * found["slider", "replies"]))
    memory = processes * found["idle", "fresh service"]
    memory += active * found["idle", "a further session with its tab"]
    behind = hourly["fits"] + hourly["swept cars"]
    kept = KEPT["sessions"] * found["session", "disk"] + KEPT["uploads"] * found["upload", "disk"]
    return {
        "at the same time": f"{active:,.0f}",
        "slider moves a second": f"{moves:,.0f}",
        "cores for services": f"{active * interactive / 3600.0 / BUSY:,.1f}",
        "service processes": f"{processes:,.0f}",
        "their memory, GB": f"{memory / 1e9:,.2g}",
        "cores for workers": f"{active * behind / 3600.0 / BUSY:,.1f}",
        "fits an hour": f"{active * USE['fits']:,.0f}",
        "connections to PostgreSQL, at most": f"{processes * CONNECTIONS:,.0f}",
        "kept on disk, GB": f"{users * kept / 1e9:,.3g}",
    }


def figures(bench: Mapping) -> dict[tuple[str, str], float]:
    """Every figure by row and name."""
    return {
        (row["name"], one["name"]): one["value"] for row in bench["rows"] for one in row["figures"]
    }


if __name__ == "__main__":
    main(sys.argv[1])
