"""Mathematics about filters and sensors: identification, optimum, divergence, frequency."""
