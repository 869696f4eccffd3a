"""Sets a run beside its mission: stops, states, distance from the route, and coverage as acquired."""
