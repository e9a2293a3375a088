"""Roads: of shapes, of ISO 8608 and from files."""
