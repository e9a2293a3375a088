"""Databases as earlier versions of the schema made them, by their DDL, with rows in every table."""

import hashlib
import json
from pathlib import Path
from typing import Any

from sqlalchemy import Connection, text

FILES = [b"0 1 2", b"the rows of a sweep", b"a part"]
SHA256 = [hashlib.sha256(data).hexdigest() for data in FILES]
TOKEN = "the token of the session"

SESSION = "FOREIGN KEY(session) REFERENCES sessions (id) ON DELETE CASCADE"
JOB = "FOREIGN KEY(job) REFERENCES jobs (id) ON DELETE CASCADE"
UPLOAD = "FOREIGN KEY(sha256) REFERENCES uploads (sha256)"
DDL: dict[str, list[tuple[int, str]]] = {
    "schema_version": [(1, "version INTEGER NOT NULL")],
    "sessions": [
        (1, "id VARCHAR(32) NOT NULL"),
        (1, "token_hash VARCHAR(64) NOT NULL"),
        (1, "created FLOAT NOT NULL"),
        (1, "seen FLOAT NOT NULL"),
        (1, "used BOOLEAN NOT NULL"),
        (1, "vehicle TEXT NOT NULL"),
        (1, "baseline TEXT NOT NULL"),
        (6, "setup TEXT"),
        (8, "owner TEXT"),
        (10, "name VARCHAR(80) NOT NULL"),
        (1, "PRIMARY KEY (id)"),
    ],
    "uploads": [
        (1, "sha256 VARCHAR(64) NOT NULL"),
        (1, "bytes INTEGER NOT NULL"),
        (1, "created FLOAT NOT NULL"),
        (1, "PRIMARY KEY (sha256)"),
    ],
    "measurements": [
        (1, "id VARCHAR(32) NOT NULL"),
        (1, "session VARCHAR(32) NOT NULL"),
        (1, "sha256 VARCHAR(64) NOT NULL"),
        (1, "name VARCHAR(200) NOT NULL"),
        (1, "created FLOAT NOT NULL"),
        (1, "sample BOOLEAN NOT NULL"),
        (1, "noise TEXT NOT NULL"),
        (1, "summary TEXT NOT NULL"),
        (3, "manoeuvre TEXT"),
        (4, "mapping TEXT"),
        (4, "conditioning TEXT"),
        (5, "conditioned TEXT"),
        (1, "PRIMARY KEY (id)"),
        (1, SESSION),
        (1, UPLOAD),
    ],
    "mappings": [
        (4, "session VARCHAR(32) NOT NULL"),
        (4, "name VARCHAR(100) NOT NULL"),
        (4, "body TEXT NOT NULL"),
        (4, "created FLOAT NOT NULL"),
        (4, "PRIMARY KEY (session, name)"),
        (4, SESSION),
    ],
    "jobs": [
        (1, "id VARCHAR(32) NOT NULL"),
        (1, "session VARCHAR(32) NOT NULL"),
        (1, "kind VARCHAR(32) NOT NULL"),
        (1, "key VARCHAR(100)"),
        (1, "state VARCHAR(16) NOT NULL"),
        (1, "spec TEXT NOT NULL"),
        (1, "progress TEXT NOT NULL"),
        (1, "error TEXT"),
        (1, "created FLOAT NOT NULL"),
        (1, "started FLOAT"),
        (1, "finished FLOAT"),
        (1, "attempts INTEGER NOT NULL"),
        (1, "restarts INTEGER NOT NULL"),
        (7, "runner VARCHAR(64)"),
        (7, "heartbeat_at FLOAT NOT NULL"),
        (7, "cancel_asked BOOLEAN NOT NULL"),
        (7, "priority INTEGER NOT NULL"),
        (1, "PRIMARY KEY (id)"),
        (1, "UNIQUE (session, key)"),
        (1, SESSION),
    ],
    "results": [
        (1, "job VARCHAR(32) NOT NULL"),
        (1, "body TEXT NOT NULL"),
        (1, "PRIMARY KEY (job)"),
        (1, JOB),
    ],
    "job_files": [
        (2, "job VARCHAR(32) NOT NULL"),
        (2, "sha256 VARCHAR(64) NOT NULL"),
        (2, "PRIMARY KEY (job)"),
        (2, JOB),
        (2, UPLOAD),
    ],
    "job_parts": [
        (7, "job VARCHAR(32) NOT NULL"),
        (7, "name VARCHAR(200) NOT NULL"),
        (7, "sha256 VARCHAR(64) NOT NULL"),
        (7, "progress TEXT NOT NULL"),
        (7, "PRIMARY KEY (job, name)"),
        (7, JOB),
        (7, UPLOAD),
    ],
    "database_identity": [(7, "id VARCHAR(32) NOT NULL")],
    "links": [
        (8, "hash VARCHAR(64) NOT NULL"),
        (8, "expires FLOAT NOT NULL"),
        (8, "PRIMARY KEY (hash)"),
    ],
    "browsers": [
        (8, "hash VARCHAR(64) NOT NULL"),
        (8, "created FLOAT NOT NULL"),
        (8, "expires FLOAT NOT NULL"),
        (9, "token_mark VARCHAR(64)"),
        (8, "PRIMARY KEY (hash)"),
    ],
    "keys": [
        (8, "name VARCHAR(100) NOT NULL"),
        (8, "hash VARCHAR(64) NOT NULL"),
        (8, "begins VARCHAR(16) NOT NULL"),
        (8, "created FLOAT NOT NULL"),
        (8, "used FLOAT"),
        (8, "PRIMARY KEY (name)"),
        (8, "UNIQUE (hash)"),
    ],
}
INDICES = [
    (1, "jobs_by_state ON jobs (state)"),
    (1, "jobs_of_session ON jobs (session, created)"),
    (1, "measurements_of_session ON measurements (session, created)"),
    (1, "measurements_of_upload ON measurements (sha256)"),
    (2, "job_files_of_upload ON job_files (sha256)"),
    (7, "job_parts_of_upload ON job_parts (sha256)"),
    (8, "sessions_of_owner ON sessions (owner)"),
    (8, "sessions_by_token ON sessions (token_hash)"),
]


def make(connection: Connection, version: int) -> dict[str, list[dict[str, Any]]]:
    """Make one of a version; the rows of each of its tables."""
    for table, parts in DDL.items():
        if there := [part for since, part in parts if since <= version]:
            connection.execute(text(f"CREATE TABLE {table} ({', '.join(there)})"))
    for since, index in INDICES:
        if since <= version:
            connection.execute(text(f"CREATE INDEX {index}"))
    rows = _rows(version)
    for table, some in rows.items():
        for row in some:
            names = ", ".join(row)
            values = ", ".join(f":{name}" for name in row)
            connection.execute(text(f"INSERT INTO {table} ({names}) VALUES ({values})"), row)
    return rows


def make_originals(data: Path) -> None:
    """The files beside it."""
    for sha256, content in zip(SHA256, FILES, strict=True):
        place = data / "originals" / sha256[:2] / sha256
        place.parent.mkdir(parents=True, exist_ok=True)
        place.write_bytes(content)


def _rows(version: int) -> dict[str, list[dict[str, Any]]]:
    columns = {
        table: {part.split()[0] for since, part in parts if since <= version}
        for table, parts in DDL.items()
    }
    return {
        table: [{name: row[name] for name in row if name in columns[table]} for row in some]
        for table, some in _all_rows(version).items()
        if columns[table]
    }


def _all_rows(version: int) -> dict[str, list[dict[str, Any]]]:
    spec = json.dumps({"runs": [], "asked": "a fit"})
    car = json.dumps({"name": "a car"})
    job = {
        "session": "s1",
        "kind": "test",
        "spec": spec,
        "created": 1e9,
        "attempts": 1,
        "runner": None,
        "heartbeat_at": 0.0,
        "cancel_asked": False,
        "priority": 0,
    }
    ended = {**job, "progress": '{"cost": 1.5}', "started": 1e9, "finished": 2e9, "restarts": 2}
    waiting = {**job, "progress": "{}", "finished": None, "restarts": 0, "error": None}
    return {
        "schema_version": [{"version": version}],
        "sessions": [
            {
                "id": "s1",
                "token_hash": hashlib.sha256(TOKEN.encode()).hexdigest(),
                "created": 1e9,
                "seen": 1.5e9,
                "used": True,
                "vehicle": car,
                "baseline": car,
                "setup": '{"starts": 8}',
                "owner": None,
                "name": "Fahrzeug 7",
            }
        ],
        "uploads": [
            {"sha256": sha256, "bytes": len(content), "created": 1e9}
            for order, (sha256, content) in enumerate(zip(SHA256, FILES, strict=True))
            if order <= (version >= 2) + (version >= 7)
        ],
        "measurements": [
            {
                "id": "m1",
                "session": "s1",
                "sha256": SHA256[0],
                "name": "Fahrt 1 für ride.csv",
                "created": 1e9,
                "sample": False,
                "noise": '{"chassis.z": 0.001}',
                "summary": '{"samples": 3}',
                "manoeuvre": '{"name": "lap"}',
                "mapping": '{"columns": []}',
                "conditioning": '{"steps": [], "vehicle": null}',
                "conditioned": '[{"step": {"kind": "rest"}}]',
            }
        ],
        "mappings": [{"session": "s1", "name": "car 7", "body": "{}", "created": 1e9}],
        "jobs": [
            {**ended, "id": "done", "key": "click", "state": "done", "error": None},
            {**ended, "id": "failed", "key": None, "state": "failed", "error": '{"code": "x"}'},
            {**waiting, "id": "running", "key": "b", "state": "running", "started": 1e9},
            {**waiting, "id": "queued", "key": None, "state": "queued", "started": None},
        ],
        "results": [{"job": "done", "body": '{"cost": 1.5}'}],
        "job_files": [{"job": "done", "sha256": SHA256[1]}],
        "job_parts": [
            {"job": "running", "name": "first", "sha256": SHA256[2], "progress": '{"cars": 9}'}
        ],
        "database_identity": [{"id": "i" * 32}],
        "links": [{"hash": "1" * 64, "expires": 2e9}],
        "browsers": [{"hash": "2" * 64, "created": 1e9, "expires": 2e9, "token_mark": None}],
        "keys": [
            {"name": "ci", "hash": "3" * 64, "begins": "rt_abc", "created": 1e9, "used": None}
        ],
    }
