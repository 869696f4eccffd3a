"""The commands, where the folders are brought together."""
