"""What the service keeps: rows in a database, and files in the data directory."""
