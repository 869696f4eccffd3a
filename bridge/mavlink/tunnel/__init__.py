"""Raw MAVLink frames over a link, and which of them may pass."""
