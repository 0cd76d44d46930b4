"""What a drift compensation does to a record: what it removes, and how much of the true rate goes with it."""
