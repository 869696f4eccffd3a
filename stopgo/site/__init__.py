"""The site: one web application to plan, push, watch, stop and review."""
