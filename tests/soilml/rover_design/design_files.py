"""A file with a question of a design, for the tests."""

STUDY = """
[rover]
mass = 12.0
wheels = 4
wheelbase = 0.40
centre_of_mass = [0.02, 0.18]
gravity = "earth"

[wheel]
radius = 0.09
width = [0.05, 0.12]
lug_height = { values = [0.0, "10 mm"] }

[soil]
name = "ding2015/hit_lss1"

[goal]
slope = "10 deg"
least = "width"
"""
