"""Background jobs of any kind: claimed in the database, run on workers, followed by who asked."""
