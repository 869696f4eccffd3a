"""Traffic of released versions, recorded between a robot and a station of that version."""
