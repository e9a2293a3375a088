"""The processes in which people's simulations run, and what happens in one of them."""
