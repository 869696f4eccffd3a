"""The bridge's commands, one module for each family."""
