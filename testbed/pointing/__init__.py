"""From rate to pointing: what an optical tracker and a mirror leave of the line of sight when a fused rate feeds the
mirror forward.

Mathematics: `blend` (tracker and rate), `actuator` (mirror), `windows` (metrics of the standard), `link`. In time:
`angle`, `command`, `tracking`, joined by `line_of_sight`, block by block. What comes of it: `judge`, `budget`.
"""
