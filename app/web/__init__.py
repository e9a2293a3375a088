"""The server itself: connections, replies, problems, budgets, and what all handlers share."""
