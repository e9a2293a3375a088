"""From the columns of any measurement file to our channels: guessed, checked, applied."""
