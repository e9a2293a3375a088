"""Log records: one line each, with what it is about: the request, the session, the job, the user.

That is kept in a context, which goes along into tasks, and into threads that are given it. No
message starts a line of its own, whatever a caller put into it, and in JSON nothing does.
"""

import json
import logging
import os
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from datetime import UTC, datetime
from typing import Literal

Form = Literal["text", "json"]
FORMS: tuple[Form, ...] = ("text", "json")
LEVELS = ("DEBUG", "INFO", "WARNING", "ERROR")
FORM, LEVEL = "RIDETUNE_LOG", "RIDETUNE_LOG_LEVEL"

_about: ContextVar[dict[str, str] | None] = ContextVar("about", default=None)
_VISIBLE = {code: f"\\x{code:02x}" for code in (*range(32), *range(127, 160))}


@contextmanager
def about(**known: str) -> Iterator[None]:
    """What records within are about, besides what those around are."""
    token = _about.set({**(_about.get() or {}), **known})
    try:
        yield
    finally:
        _about.reset(token)


def tell(**known: str) -> None:
    """Add what is learned on the way, as who the user is; also from a thread."""
    if (now := _about.get()) is not None:
        now.update(known)


def known_about() -> Mapping[str, str]:
    """What records made here are about."""
    return _about.get() or {}


class JsonLines(logging.Formatter):
    """One JSON object a line."""

    def format(self, record: logging.LogRecord) -> str:
        """The line of a record."""
        line = {
            "time": _instant(record),
            "level": record.levelname,
            "logger": record.name,
            "message": record.getMessage(),
            **known_about(),
            **getattr(record, "fields", {}),
        }
        if record.exc_info:
            line["traceback"] = self.formatException(record.exc_info)
        return json.dumps(line, default=str)


class TextLines(logging.Formatter):
    """One line a record; a traceback follows, indented."""

    def format(self, record: logging.LogRecord) -> str:
        """The line of a record."""
        message = record.getMessage().translate(_VISIBLE)
        told = " ".join(f"{name}={value}" for name, value in known_about().items())
        suffix = f" [{told.translate(_VISIBLE)}]" if told else ""
        line = f"{_instant(record)} {record.levelname} {record.name}: {message}{suffix}"
        if not record.exc_info:
            return line
        trace = self.formatException(record.exc_info).split("\n")
        return "\n".join([line, *(f"    {part.translate(_VISIBLE)}" for part in trace)])


def configure(form: Form, level: str) -> None:
    """Write this process's records to standard error: our own from a level on, of others warnings
    only, whose lesser records have addresses with their queries.
    """
    handler = logging.StreamHandler()
    handler.setFormatter(JsonLines() if form == "json" else TextLines())
    logging.basicConfig(level=logging.WARNING, handlers=[handler], force=True)
    logging.getLogger("ridetune").setLevel(level)
    # What is wrong with an upload is told to whoever sent it, who could else fill the log.
    logging.getLogger("python_multipart").setLevel(logging.ERROR)
    logging.captureWarnings(True)
    threading.excepthook = _log_thread


def configure_worker() -> None:
    """The same in a job worker, as its environment says; done once, whoever comes first."""
    if not any(isinstance(handler.formatter, JsonLines | TextLines) for handler in _root.handlers):
        form = os.environ.get(FORM, "")
        level = os.environ.get(LEVEL, "")
        configure("json" if form == "json" else "text", level if level in LEVELS else "WARNING")
        adopt("distributed")
        logging.getLogger("distributed.worker.state_machine").addFilter(_unless_closing)


def adopt(*loggers: str) -> None:
    """Let a library's warnings go the way of ours, where it has handlers and levels of its own."""
    for name, logger in logging.root.manager.loggerDict.items():
        if isinstance(logger, logging.Logger) and name.partition(".")[0] in loggers:
            logger.handlers.clear()
            logger.propagate = True
            logger.setLevel(max(logger.level, logging.WARNING))


_root = logging.getLogger()


def _unless_closing(record: logging.LogRecord) -> bool:
    """A Dask worker that ends in good order warns of each task that it had; whoever ended it knows,
    and has the task run again.
    """
    return not record.getMessage().endswith("ended with CancelledError")


def _log_thread(failed: threading.ExceptHookArgs) -> None:
    name = failed.thread.name if failed.thread else "unknown"
    if failed.exc_value is not None:
        found = (failed.exc_type, failed.exc_value, failed.exc_traceback)
        _root.error("the thread %s ended unexpectedly", name, exc_info=found)


def _instant(record: logging.LogRecord) -> str:
    instant = datetime.fromtimestamp(record.created, UTC)
    return instant.isoformat(timespec="milliseconds").replace("+00:00", "Z")
