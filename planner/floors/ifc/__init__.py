"""Storeys of building models: `storey_reader` reads them, `extract` loads a model in a process of its own."""
