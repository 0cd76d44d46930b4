"""How this project draws and prints: colours, numbers, axes, SVG and HTML. It knows nothing of runs."""
