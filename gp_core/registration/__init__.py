"""Registration of point sets: Procrustes, JRMPC, ICP."""
