"""The mission protocol: lists of items onto a vehicle, and back to be compared."""
