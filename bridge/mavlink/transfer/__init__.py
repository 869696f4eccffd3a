"""The mission protocol: lists of items sent to a vehicle, and read back for comparison."""
