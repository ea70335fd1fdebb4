"""The tracked probe: its card in the step Pose, and the dialog that connects it."""
