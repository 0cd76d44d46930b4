"""The commands: each reads its options, calls the rooms below and hands the result to the terminal."""
