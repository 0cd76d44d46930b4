"""What the filters share that divide the band between two sensors."""
