"""What the service is there for: each job and simulation, from what was asked to its result."""
