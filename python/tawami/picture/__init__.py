"""Pictures of particles and the one style of all figures. It knows matplotlib and no mechanics.

matplotlib is imported when the first picture is drawn.
"""
