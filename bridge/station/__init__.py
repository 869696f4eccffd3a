"""The station: it pushes a mission, sends commands, and follows a run."""
