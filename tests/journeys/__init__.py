"""The README's commands, run as a user would."""
