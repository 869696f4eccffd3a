"""The files a mission is written to and read from, one module per format."""
