"""The station's end: it pushes a mission, gives orders, and follows a run."""
