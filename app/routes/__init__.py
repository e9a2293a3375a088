"""The REST interface and its websocket, one module a kind of thing."""
