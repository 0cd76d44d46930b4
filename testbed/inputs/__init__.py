"""What comes in from outside, bounded before it is used: regular files of a size, YAML of a size and depth."""
