"""How well a car predicts runs, those it was identified from and those held out."""
