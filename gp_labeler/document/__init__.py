"""A specimen as it is edited: its state, edits, history, journal and files. No Qt, no VTK."""
