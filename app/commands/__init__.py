"""One module a command; each reads its files, calls the engine and prints a report."""
