"""`ridetune bench`: the engine and its peers measured in one run on one machine."""
