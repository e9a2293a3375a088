"""How the running service bears its users: what they wait for, what they cost, what it takes."""
