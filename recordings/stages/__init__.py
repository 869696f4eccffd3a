"""The stages of a plan as they are drawn: one file per noun, its 2D and its 3D side by side."""
