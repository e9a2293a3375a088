"""From recorded runs to the car's parameters, and what the runs determine of them."""
