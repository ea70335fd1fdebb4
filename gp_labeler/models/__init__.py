"""What the window, a script and Python drive: scan, bone, labels, atlas, pose, tracker. No Qt, no VTK."""
