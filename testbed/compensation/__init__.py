"""Temperature drift of a fibre-optic gyro: the parts and the pipeline of paper 3, and a model that is trained on other
cycles, frozen, and sees temperature only.
"""

PAPER = "paper3"  # names the paper's own protocol where a trained model would stand
