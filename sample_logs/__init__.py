"""Floor 2: the sample drives, and what makes them."""
