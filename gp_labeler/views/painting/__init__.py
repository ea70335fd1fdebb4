"""What QPainter draws, over slices and over the 3D view alike."""
