"""Drawing in Rerun: canvas, pens, palette, strokes and the blueprint."""
