"""The tables of the service's database.

Times are seconds since 1970. JSON is kept as text, written and read whole. An upload is one file,
kept once under its SHA-256 however many measurements are made of it; what a job makes is one too,
and so is each part of it that is kept while it runs.
"""

from sqlalchemy import (
    BigInteger,
    Boolean,
    Column,
    Float,
    ForeignKey,
    Index,
    Integer,
    MetaData,
    String,
    Table,
    Text,
    UniqueConstraint,
)

from ..session_name import DEFAULT, LONGEST

MIGRATIONS: tuple[tuple[str, ...], ...] = (
    (),  # Tables that a version lacks are made anyway: here the files of jobs.
    ("ALTER TABLE measurements ADD COLUMN manoeuvre TEXT",),
    (
        "ALTER TABLE measurements ADD COLUMN mapping TEXT",
        "ALTER TABLE measurements ADD COLUMN conditioning TEXT",
    ),
    ("ALTER TABLE measurements ADD COLUMN conditioned TEXT",),
    ("ALTER TABLE sessions ADD COLUMN setup TEXT",),
    (
        "ALTER TABLE jobs ADD COLUMN runner VARCHAR(64)",
        "ALTER TABLE jobs ADD COLUMN heartbeat_at FLOAT NOT NULL DEFAULT 0",
        "ALTER TABLE jobs ADD COLUMN cancel_asked BOOLEAN NOT NULL DEFAULT FALSE",
        "ALTER TABLE jobs ADD COLUMN priority INTEGER NOT NULL DEFAULT 0",
    ),
    (
        "ALTER TABLE sessions ADD COLUMN owner TEXT",
        "CREATE INDEX sessions_of_owner ON sessions (owner)",
        "CREATE INDEX sessions_by_token ON sessions (token_hash)",
    ),
    ("ALTER TABLE browsers ADD COLUMN token_mark VARCHAR(64)",),
    ("ALTER TABLE sessions ADD COLUMN name VARCHAR(80) NOT NULL DEFAULT 'Project'",),
)
"""What leads from each version of the schema, the first being 1, to the next."""

SCHEMA_VERSION = 1 + len(MIGRATIONS)

metadata = MetaData()

schema_version = Table("schema_version", metadata, Column("version", Integer, nullable=False))

database_identity = Table("database_identity", metadata, Column("id", String(32), nullable=False))


def _session() -> Column[str]:
    return Column(
        "session", String(32), ForeignKey("sessions.id", ondelete="CASCADE"), nullable=False
    )


sessions = Table(
    "sessions",
    metadata,
    Column("id", String(32), primary_key=True),
    Column("token_hash", String(64), nullable=False),
    Column("created", Float, nullable=False),
    Column("seen", Float, nullable=False),
    Column("used", Boolean, nullable=False, default=False),
    Column("vehicle", Text, nullable=False),
    Column("baseline", Text, nullable=False),
    Column("setup", Text),
    Column("owner", Text),  # null: whoever holds the token
    Column("name", String(LONGEST), nullable=False, default=DEFAULT),
)

links = Table(
    "links",
    metadata,
    Column("hash", String(64), primary_key=True),
    Column("expires", Float, nullable=False),
)

browsers = Table(
    "browsers",
    metadata,
    Column("hash", String(64), primary_key=True),
    Column("created", Float, nullable=False),
    Column("expires", Float, nullable=False),
    Column("token_mark", String(64)),  # of the service's token; null: by a link
)

keys = Table(
    "keys",
    metadata,
    Column("name", String(100), primary_key=True),
    Column("hash", String(64), nullable=False, unique=True),
    Column("begins", String(16), nullable=False),
    Column("created", Float, nullable=False),
    Column("used", Float),
)

uploads = Table(
    "uploads",
    metadata,
    Column("sha256", String(64), primary_key=True),
    Column("bytes", BigInteger, nullable=False),
    Column("created", Float, nullable=False),
)

measurements = Table(
    "measurements",
    metadata,
    Column("id", String(32), primary_key=True),
    _session(),
    Column("sha256", String(64), ForeignKey("uploads.sha256"), nullable=False),
    Column("name", String(200), nullable=False),
    Column("created", Float, nullable=False),
    Column("sample", Boolean, nullable=False, default=False),
    Column("noise", Text, nullable=False, default="{}"),
    Column("summary", Text, nullable=False),
    Column("manoeuvre", Text),
    Column("mapping", Text),
    Column("conditioning", Text),
    Column("conditioned", Text),
)

mappings = Table(
    "mappings",
    metadata,
    Column("session", String(32), ForeignKey("sessions.id", ondelete="CASCADE"), primary_key=True),
    Column("name", String(100), primary_key=True),
    Column("body", Text, nullable=False),
    Column("created", Float, nullable=False),
)

jobs = Table(
    "jobs",
    metadata,
    Column("id", String(32), primary_key=True),
    _session(),
    Column("kind", String(32), nullable=False),
    Column("key", String(100)),
    Column("state", String(16), nullable=False),
    Column("spec", Text, nullable=False),
    Column("progress", Text, nullable=False, default="{}"),
    Column("error", Text),
    Column("created", Float, nullable=False),
    Column("started", Float),
    Column("finished", Float),
    Column("attempts", Integer, nullable=False, default=0),
    Column("restarts", Integer, nullable=False, default=0),
    Column("runner", String(64)),
    Column("heartbeat_at", Float, nullable=False, default=0.0),
    Column("cancel_asked", Boolean, nullable=False, default=False),
    Column("priority", Integer, nullable=False, default=0),
    UniqueConstraint("session", "key"),
)

results = Table(
    "results",
    metadata,
    Column("job", String(32), ForeignKey("jobs.id", ondelete="CASCADE"), primary_key=True),
    Column("body", Text, nullable=False),
)

job_files = Table(
    "job_files",
    metadata,
    Column("job", String(32), ForeignKey("jobs.id", ondelete="CASCADE"), primary_key=True),
    Column("sha256", String(64), ForeignKey("uploads.sha256"), nullable=False),
)

job_parts = Table(
    "job_parts",
    metadata,
    Column("job", String(32), ForeignKey("jobs.id", ondelete="CASCADE"), primary_key=True),
    Column("name", String(200), primary_key=True),
    Column("sha256", String(64), ForeignKey("uploads.sha256"), nullable=False),
    Column("progress", Text, nullable=False, default="{}"),
)

Index("sessions_of_owner", sessions.c.owner)
Index("sessions_by_token", sessions.c.token_hash)
Index("measurements_of_session", measurements.c.session, measurements.c.created)
Index("measurements_of_upload", measurements.c.sha256)
Index("job_files_of_upload", job_files.c.sha256)
Index("job_parts_of_upload", job_parts.c.sha256)
Index("jobs_of_session", jobs.c.session, jobs.c.created)
Index("jobs_by_state", jobs.c.state)
