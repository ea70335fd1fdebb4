"""What the user is doing: the specimen, its edits, and what is safe on disk. No Qt, no VTK."""
