"""Conformance tests of third-party robots and stations against docs/reference/protocol.md."""
