"""The panel of the step Pose: its cards and its dialogs."""
