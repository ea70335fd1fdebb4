"""Rigid registration: corresponding points (Procrustes), many sets at once (JRMPC), surfaces (ICP)."""
