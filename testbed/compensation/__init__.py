"""Temperature drift of a fibre-optic gyro: what paper 3 does, part by part and as a whole, and a compensator that is trained on other thermal cycles, frozen, and then sees temperature only."""
