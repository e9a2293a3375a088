"""From raw recordings to what an identification needs, step by step (docs/conditioning.md)."""
